"""Transforms, cameras and ground models in plain numpy; each module states its conventions at its head.

transforms      rigid transforms and projection
similarity      similarity transforms, fitted to pairs of points
camera_models   COLMAP's camera models, their scaling, and poses between conventions
views           posed views, points and tracks, and their files: the conventions of the whole project
geodesy         latitude, longitude, altitude <-> east, north, up
up_direction    which way is up, from cameras and points alone
shared_points   how many points each pair of views shares
spread          positions spread evenly over the ground
footprint       how large a piece of ground a view sees, and how far two pieces lie apart
ground_surface  a surface z(x, y): its height, and where rays meet it
ground_model    that surface, fitted to the points of a scene
ground_tiles    a large ground in tiles of about equal numbers of samples
depth_maps      depth and normal maps as files
fused           fused points and their file
stored_points   the same, of which any part is read alone
ply             coloured meshes and their file
textured        textured meshes and their files
raycast         rays against a mesh (open3d)
masks           masks of photographs
area_mean       pictures at another size
robust          the spread of errors of which some are wild
rows            the rows of a table by one of its columns
"""
