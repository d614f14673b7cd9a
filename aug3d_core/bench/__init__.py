"""Measure again, on this machine, the figures that the issues, the README and the docs quote.

machine   what was measured on
trial     a configuration, run as far as a figure needs, in a store of its own
geometry  poses, depth and mesh of the town against its truth
orthophoto, cloud   its map and its points as they are exported, against its truth
tiles     its surface in several tiles of ground, against that in one
grouping, edge_cases   bad members of every way of grouping, on every flight path and on the paper's edge cases
"""
