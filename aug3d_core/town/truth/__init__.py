"""Compare reconstructions with the town: poses, mesh, overlap, buildings; and small exact worlds.

true_views        the true poses of the photographs that were reconstructed
pose_errors       how far poses are off
truth_stage       the stage `truth`
surface_samples   points spread evenly over a mesh
mesh_errors       how far a mesh is off
error_map         a map of that
mesh_truth_stage  the stage `mesh_truth`
overlap_stage     the stage `overlap` on the true town
building_boxes    where buildings truly are, and how well found boxes meet them
patchwork         small exact worlds of rectangles
edge_cases        the paper's edge cases of grouping as such worlds
"""
