"""Studies: the paper's tables, time against accuracy, stability, generalisation.

named           the studies by their names and what they are asked for with
paper           the paper's tables
tradeoff        time against accuracy
stability       at which dose each method breaks
generalisation  how good a model is on a place that it never saw
common          what they share
"""
