"""A town with exact truth, flown over by a virtual drone; rendered through rendering/'s door.

* `config`      size, flight and camera of the town
* `noise`       fractal noise and other texture grain
* `plan`, `planning`, `streets`, `blocks`   what stands where
* `ground`      the painted ground
* `atlas`, `model`   texture patches, and triangles that point into them
* `swatches`, `facades`, `roofs`, `buildings`, `trees`, `cars`   what stands on the ground
* `town`        all of it together, bent over gentle hills
* `flight`, `photo`   where the drone was, and the JPEG it wrote
* `town_stage`  render the flight
* `truth_stage`, `pose_errors`   compare reconstructed poses with the true ones
* `mesh_truth_stage`, `mesh_errors`, `error_map`   compare the reconstructed mesh, and its renders; `surface_samples` spreads points
"""
