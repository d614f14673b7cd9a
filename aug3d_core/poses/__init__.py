"""Camera poses from elsewhere: COLMAP, nerfstudio, Mega-NeRF.

recognise     the kind of pose file (light: the flow's own process asks)
colmap        COLMAP model -> poses (pycolmap)
colmap_check  whether a binary model is complete
nerfstudio    transforms.json -> poses
mega_nerf     Mega-NeRF folder -> poses
torch_files   `.pt` files -> plain values, without running code in them (torch)
entry, match  a pose of a file, and the photograph that it belongs to
files         the table of poses that later stages read
stage         the stage `poses`
"""
