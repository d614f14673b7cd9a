"""The sections of the scene report: each is a function from a run to HTML, empty if there is nothing to show.

answer      for those who read nothing else: is it good enough, where not, what to do
verdicts    the traffic lights at the top, with their bounds
remedies    what helps where a check is not good
headline    name, state, cost, failure, the model compared with the cheap answers
compared    what changed since the published version
overview    the map: cameras by role and group
map_layers  its layers: ground, domes, GPS errors, scale
gps         distances between cameras and their GPS positions
control     ground control points, and how far off the reconstruction is at each
cameras     photographs with and without a pose, reprojection and GPS errors
tracks      track lengths, and how many photographs see each piece of ground
groups      similarity, groups, grouping methods
surface     depth and mesh
virtual     domes, kept and rejected views
dataset     contents, and the leak audit
answers     the test: curves, groups, photographs, panels
needs       decisions and their reasons
cost        time, memory and disk space of every stage
origin      versions, seeds, digests, settings
"""
