"""Decide which photographs belong together, and which of them are kept for the test.

similarity        visibility -> number of shared points of every pair of views
similarity_stage  the stage that writes it
scene             what every way of grouping may look at
methods           the ways of grouping by name
spread            choose centres evenly over the ground, and places in a row
sequence          group by capture order
grid              group by where cameras stand, with or without where they look
ray               group by where central rays meet the ground
shared_points     group by shared points
surface           group by seen surface
surface_cells     what surface each view sees, by rays on the points
similar           group by any matrix of similarities
twins             photographs taken in one pose
footprint         how large a piece of ground a view sees, and how far apart two of them lie
cluster_size      K by itself: as many as overlap
left_out          views in no group, and why
split             a block of ground for the test, a gap around it, the rest for training; `roles` reads it
audit             figures that say how good groups and split are
picture           the pictures that people look at
stage             the stage
read_scene        what the stages before it wrote
overlap           how much of the same surface two views really see, by rays on a mesh; `pair_overlaps` keeps it
measures          how good groups are: shared points, bad members, coverage, likeness
comparison        every way of grouping on the same views, measured alike
group_map, columns, places   sample groups of every way as a map, and as columns of photographs
overlap_stage     the stage that tells and shows it
"""
