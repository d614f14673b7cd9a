"""Recover camera poses, points and tracks from photographs, in a level world. The only door to pycolmap.

pairs            which photographs to match with which (plain numpy)
features         photo table -> database of features and verified matches
match_worker     the process that matches a share of the pairs
mapping          database -> reconstructions, the largest first
grow             start from an earlier reconstruction of most of the photographs
refusal          photographs that cannot become a scene, and why
camera_model     the smallest camera model that predicts the photographs; EXIF's focal length where they cannot tell better
align            reconstruction -> ENU metres by control points or GPS, or level scene units without
control          where a reconstruction has ground control points, and how far off it is there (plain numpy)
doming           how far the flight is bent against GPS altitudes (plain numpy)
rolling_shutter  how far the camera flew on while its sensor was read row by row (plain numpy)
unplaced         which photographs fell out, and the likely reason
spread           how far repeated reconstructions are apart (plain numpy)
falloff          how much light a lens loses in its corners, and photographs without that (plain numpy)
camera_falloffs  the falloff of each camera of a reconstruction
export           reconstruction -> undistorted images and plain arrays
write            a finished reconstruction -> the world, and the files that later stages read
picture          the map that people look at
stage            the stage
"""
