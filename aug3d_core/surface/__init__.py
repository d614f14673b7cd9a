"""A textured mesh from fused depth and the photographs.

config    settings and their presets
draw      the surface, as a whole or tile by tile
tiles     the ground in tiles of about equal numbers of points
evidence  which fused points may be used
hidden    the ground and the foot of a wall that hardly any photograph sees
poisson   oriented points to a surface
trim      the surface only where points speak for it
decimate  no more triangles than it needs
clip, join   a mesh cut at the borders of its tile, and two that meet at one made one
build     a surface and the photos of some roles -> a coloured mesh
shape     splitting, cutting and cleaning of triangles (numpy)
exposure  how the photographs' exposures differ
colour    colours of places on the surface from the photographs that see them best
atlas     where each triangle lies in the texture
texture   every texel coloured as a vertex is
clock     what each step took
kept      what a try after a kill goes on with
checks    the mesh beside the photographs: PSNR, coverage, pictures
meshes    both meshes (train photos alone; everything but the targets), side by side where there is room
stage     what they look like beside the photographs, and the renders at the targets
"""
