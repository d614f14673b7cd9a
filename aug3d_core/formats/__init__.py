"""Camera poses from elsewhere, and poses for elsewhere: COLMAP, nerfstudio, Mega-NeRF, DTU.

recognise    which kind of pose file lies where the user points (light: the flow's own process asks)
cameras      camera models and their exact scaling; checked poses between conventions (plain numpy)
given        the poses as the poses stage hands them on: one JSON table, whatever they came from
colmap       COLMAP model -> poses (pycolmap)
colmap_check is a binary COLMAP model whole? (plain Python)
nerfstudio   transforms.json -> poses
mega_nerf    Mega-NeRF folder -> poses
torch_files  `.pt` files -> plain values, without running code in them (torch)
match        names in a pose file -> photographs of the photo table
stage        the poses stage
export       a finished scene -> COLMAP or nerfstudio
dtu          the groups of a packed scene -> the DTU layout of the original pixelNeRF code
folder       where an export goes
colmap_text  views, points and tracks -> a COLMAP model as text
"""
