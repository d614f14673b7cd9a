"""Where virtual cameras stand: domes over the surface, each one group of views that overlap well.

config         settings and their presets
height_raster  the surface seen from above: heights, colours, how much of a cell it fills
read           what the stage reads, checked
site           what a sampler may know: the ground, the lens, the finest sampling that photos and mesh justify
justified      that sampling from place to place: where photos see the surface from afar and aslant, renders are smeared
dome           camera poses on a piece of a sphere (pure geometry)
conditioning   which of these are free of the surface and see enough of it
place          one dome over a place, or the reason why none stands there
methods        the samplers by name; each is a file with `plan(surface, site, config, rng)`
sam_weights    what the method sam needs, also for a look before a run
orthographic   which squares of the surface seen from above are built
boxes          their boxes, merged ones, and the file of both
building_chart  a picture of them
cameras        the table of planned cameras and its file
sight          sample points of the surface, and from where and how finely a camera sees them
reach          how much of the surface, from how many directions, photographs and domes show
greedy         choosing few sets that cover much
choice         which of many candidate domes, and which of their cameras, are worth rendering
chart          the map of domes and cameras, and the chart of what they reach
report         figures, the table of domes, notes
stage          the sampling stage
"""
