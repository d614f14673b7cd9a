"""How much of the same surface the members of groups really see, for every way of grouping.

true_overlap   overlap of two views, by rays on a mesh
pair_overlaps  all pairs, measured once
measures       bad members, coverage, likeness of groups
comparison     every way of grouping on the same views
places         sample groups for pictures
group_map, columns  the pictures
stage          the stage `overlap`
"""
