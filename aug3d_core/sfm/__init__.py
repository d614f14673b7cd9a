"""Recover camera poses, points and tracks from photographs, in a level world. The only door to pycolmap.

pairs     which photographs to match with which (plain numpy)
features  photo table -> database of features and verified matches
mapping   database -> reconstructions, the largest first
focal     keep the camera's own focal length where the photographs cannot tell better
align     reconstruction -> ENU metres by GPS, or level scene units without
export    reconstruction -> undistorted images and plain arrays
write     a finished reconstruction -> the world, and the files that later stages read
picture   the map that people look at
stage     the stage
"""
