"""A town with exact truth, flown over by a virtual drone; rendered through rendering/'s door.

* `config`      size, flight and camera of the town
* `noise`       fractal noise and other texture grain
* `plan`, `planning`, `streets`, `blocks`   what stands where
* `ground`      the painted ground
* `atlas`, `model`   texture patches, and triangles that point into them
* `swatches`, `facades`, `roofs`, `buildings`, `trees`, `cars`   what stands on the ground
* `estates`     blocks of towers, or of one house repeated; `lake` floods a part of the town
* `terrain`     hills, slope or terraces, and how the plan is bent into the world
* `town`        all of it together
* `paths`, `flight`   where the drone was meant to be, and was
* `lens`, `sensor`, `gps`   what is wrong with the pictures and with what the drone knows
* `develop`, `photo`   from a render to the JPEG that the camera wrote
* `town_stage`  render the flight
* `truth_stage`, `pose_errors`   compare reconstructed poses with the true ones
* `mesh_truth_stage`, `mesh_errors`, `error_map`   compare the reconstructed mesh, and its renders
* `overlap_stage`   what members of groups really see alike, on the true town
* `edge_cases`, `patchwork`   small exact worlds on which some way of grouping goes wrong
* `building_boxes`   compare the buildings found with the true ones
* `surface_samples`   points spread evenly over a mesh
"""
