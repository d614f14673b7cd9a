"""Measure again, on this machine, the figures that the issues, the README and the docs quote.

machine   what was measured on
trial     a configuration, run as far as a figure needs, in a store of its own
geometry  poses, depth and mesh of the town against its truth; what each setting buys
front     time against accuracy: the table and the chart
"""
