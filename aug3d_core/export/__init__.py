"""A finished scene -> the formats of other programs.

folder_formats  poses, points and photographs -> COLMAP or nerfstudio
colmap_text     views, points and tracks -> a COLMAP model as text
maps            the mesh from above -> orthophoto and surface model as GeoTIFF, cameras as GeoJSON and KML
points          fused points -> LAZ, and PLY for trainers of splats
utm             places of the world -> the UTM zone that maps and points lie in
finished        what they read: the mesh, and where it lies
glb             the mesh with its texture -> GLB, and where it lies
dtu             the groups of a packed scene -> the DTU layout of the original pixelNeRF code
packed          the data sets of a collection -> the layouts that other models train on
taken           what is handed over of them: sequences of views, at the size that is wanted
chunks          of pixelSplat, MVSplat and DepthSplat
wai             of map-anything
plain           of nerfstudio and COLMAP, a folder for each sequence
target_folder   check the folder that is written to
"""
