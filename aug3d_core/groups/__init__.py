"""Decide which photographs belong together.

similarity_stage  number of shared points for every pair of views
scene             what a way of grouping may look at
read_scene        reads it from earlier stages
methods           the ways of grouping, by name
surface_cells     the surface that each view sees, by rays on the points
twins             photographs taken in one pose
spare             photographs that show nothing of their own
cluster_size      K, where it is `auto`
left_out          views in no group, and why
audit             figures of groups and split
picture           the pictures of the stage
stage             the stage `grouping`: test split and groups
"""
