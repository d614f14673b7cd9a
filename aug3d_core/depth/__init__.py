"""Poses and images -> a depth and a normal map for each photograph, and the points that several agree on.

cameras       pinhole cameras at the size of the depth maps (plain numpy)
sources       which photographs each one is compared with (plain numpy)
ranges        how near and far, how low and high each photograph sees (plain numpy)
planes        the planes to try, no more than the photographs can tell apart (plain numpy)
search        the planes for one photograph, after a quick look for the highest and lowest places
sweep         the plane on which the sources agree best with each pixel (OpenCV)
coherence     depth without islands, filled from half the size (OpenCV)
normals       depth map -> normal map (OpenCV)
consistency   what depth maps of other photographs confirm (plain numpy)
reuse         maps of an earlier output that would come out the same, copied
job           what a worker process does
worker        the process that sweeps, or compares, one share of the photographs
launch        run the workers
workspace     COLMAP's dense workspace: its sparse model and lists (pycolmap)
patch_match   COLMAP's own stereo, on a CUDA GPU (pycolmap)
fusion        depth maps -> fused points (pycolmap)
fusion_tiles  the same, tile by tile of ground where there are many maps (pycolmap)
picture       photo, depth and normals side by side
stage         the stage
"""
