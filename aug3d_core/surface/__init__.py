"""A coloured mesh from the photographs' points: the only door to open3d.

config    settings and their presets
evidence  which points may be used, and their normals towards the cameras
continuation  the ground between and beyond the points, where photos look
poisson   oriented points to a surface
build     one mesh from the photos of some roles
footprint where there is evidence for a surface, and where there is none
shape     splitting, cutting and cleaning of triangles (numpy)
raycast   rays, renders and distances against a mesh
colour    vertex colours from the photographs that see a vertex best
checks    the mesh beside the photographs: PSNR, coverage, pictures
stage     both meshes (train photos alone; everything but the targets) and the renders at the targets
"""
