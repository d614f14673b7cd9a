"""Where virtual cameras stand: domes over the surface, each one group of views that overlap well.

config       settings and their presets
ground       the surface seen from above: heights, colours, how much of a cell it fills
site         what a sampler may know: the ground, the lens, the finest sampling that photos and mesh justify
dome         camera poses on a piece of a sphere (pure geometry)
conditioning which of these are free of the surface and see enough of it
grid         domes over the cells of one grid; other samplers are its siblings, `plan(surface, site, config, rng)`
cameras      the table of planned cameras and its file
chart        the map of domes and cameras
stage        the sampling stage
"""
