"""Towns packed straight from their truth: data sets with exact poses and depth, without any reconstruction.

config    the settings of such a town
declared  its stage
draw      towns of every kind, by number
groups    which views show the same ground, counted on their depth
stage     the stage `exact_town`: town -> data set
"""
