"""Pack real and rendered views of one scene into one Zarr store, and read it back.

config       what a data set should be
images       the one colour and resize convention
slab         the layer between ground and roofs in which everything to be seen lies
bounds       near and far of a view
scene        the packed scene in memory, and what must hold of it
by_view      its pictures, made or read when they are asked for
on_disk      its pictures, left in the store until then
scale        how far the ground usually is from the cameras
real         photographs -> packed views, with the depth that stereo is sure of
scaffold     depth of the mesh at the views' poses
rendered     renders of domes -> packed views, and the domes that are still groups
photographs  registered photographs alone as a scene: to predict from, not to train on
leaks        the audit that no test pixel reaches training
writer       scene -> Zarr v3
reader       Zarr v3 -> scene
batches      the groups of a training step
rays         pixels -> rays
projection   where views see the ground, where points lie in views
new_views    views without pixels
warp         the rays of a target, and what other views show along them (torch)
contact      the contact sheet
stage        the stage `dataset`
"""
