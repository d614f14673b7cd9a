"""Recover camera poses, points and tracks from photographs, or take given poses, in a level world.

pycolmap is imported here, in `depth` and in `poses/colmap.py` alone.

matching_stage   the stage `matching`
look             photographs by their largest features, before any is matched
coarse           how alike photographs are by these (plain numpy)
retrieval        which photographs may show the same ground, by one vector for each (plain numpy)
pairs            which photographs to match with which (plain numpy)
features         photo table -> database of features and verified matches
match_worker     the process that matches a share of the pairs
matching_shards  a share of features or matches, for other machines
reuse            features and matches of known photographs, from an earlier database
matching_table   features and matches of each photograph
mapping          database -> reconstructions, the largest first
segments         photographs placed in segments, so that a killed run goes on
camera_model     the smallest camera model that predicts the photographs; EXIF's focal length where they cannot tell better
grow             start from an earlier reconstruction of most of the photographs
hold             keep the earlier photographs where they were, if the new ones fit that
refusal          photographs that cannot become a scene, and why
unplaced         which photographs fell out, and the likely reason
joint            where a reconstruction hinges on few points (plain numpy)
align            reconstruction -> ENU metres by control points or GPS, or level scene units without
control          where a reconstruction has ground control points, and how far off it is there (plain numpy)
control_adjustment  bend it to them, where that helps
doming           how far the flight is bent against GPS altitudes (plain numpy)
gimbal           how far it is bent by how a drone hangs its camera (plain numpy)
straighten       take that bend out
rolling_shutter  how far the camera flew on while its sensor was read row by row (plain numpy)
spread           how far repeated reconstructions are apart (plain numpy)
falloff          how much light a lens loses in its corners, and photographs without that (plain numpy)
camera_falloffs  the falloff of each camera of a reconstruction
export           reconstruction -> undistorted images and plain arrays
write            a finished reconstruction -> the world, and the files that later stages read
picture          the map that people look at
stage            the stage
given_model      given poses -> a reconstruction
agreement        whether photographs show what the points say (plain numpy)
import_stage     the stage `sfm` from given poses
"""
