"""The sections of the scene report, each a function from a run to HTML, empty where the run has nothing to tell.

run        what a section reads: records and files of a run, as one fold sees them
verdicts   the traffic lights at the top, with the bounds they go by
headline   name, state, cost, failure, the model beside the cheap answers
compared   what changed since the published version
overview   the map: cameras by role and group
map_layers what lies on it: ground, domes, GPS errors, scale
gps        how far cameras are from their GPS positions
cameras    photographs placed or not, errors of pixels and of GPS
tracks     track lengths, and how many photographs see each piece of ground
groups     similarity, groups, ways of grouping
surface    depth and mesh
virtual    domes, kept and rejected views
dataset    what is packed, and the leak audit
answers    the test: curves, groups, photographs, panels
needs      what the scene needed and why
cost       seconds, memory and size of every stage
origin     versions, seeds, digests, settings
"""
