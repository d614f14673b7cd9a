"""A finished scene -> the formats of other programs.

folder_formats  poses, points and photographs -> COLMAP or nerfstudio
colmap_text     views, points and tracks -> a COLMAP model as text
maps            the mesh from above -> orthophoto and surface model as GeoTIFF, cameras as GeoJSON
finished        what both read: the mesh, and where it lies
glb             the mesh with its texture -> GLB, and where it lies
dtu             the groups of a packed scene -> the DTU layout of the original pixelNeRF code
target_folder   check the folder that is written to
"""
