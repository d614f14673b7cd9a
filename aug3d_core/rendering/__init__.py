"""Render views of a mesh with Cycles in worker processes. This package is the only door to bpy.

job      what is to be rendered, as small records; knows nothing of bpy
launch   run a job in worker processes, with progress, cost and a typed error
worker   the render process: load the meshes once, render the shards
blender  the bpy scene: meshes, light, camera, pixels
colour   linear light and 8-bit sRGB
given    read and check the cameras and the mesh of earlier stages
probe    choose the number of samples
quality  measure each view and drop bad ones
sheet    contact sheet
stage    render every planned view
"""
