"""Render views of a mesh with Cycles, in worker processes: the only door to bpy.

* `job`      what is to be rendered, as a small record; knows nothing of bpy
* `launch`   run a job in a worker process, with progress and a typed error
* `worker`   the process: load the meshes once, render the views, write one shard
* `blender`  the bpy scene: meshes, light, camera, pixels out
* `exr`      read the float image that Blender writes
* `colour`   linear light and 8-bit sRGB
* `stage`    every virtual camera of the plan, shard by shard
* `sheet`    contact sheet
"""
