"""Render views of a mesh with Cycles, in worker processes: the only door to bpy.

* `job`      what is to be rendered, as small records; knows nothing of bpy
* `launch`   run a job in worker processes, with progress, cost and a typed error
* `worker`   the process: load the meshes once, render shard after shard
* `blender`  the bpy scene: meshes, light, camera, pixels out
* `exr`      read the float image that Blender writes
* `colour`   linear light and 8-bit sRGB
* `given`    the cameras and the mesh of the stages before, checked
* `probe`    how many samples are enough
* `quality`  what tells a good render from a bad one
* `stage`    every virtual camera of the plan, shard by shard
* `sheet`    contact sheet
"""
