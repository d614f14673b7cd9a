"""What every study shares: cells, trials, the loop over them, and what is published.

cell          an arm with a seed, and its result; the loop over cells
trial         makes a configuration as far as a figure needs
publication   what a study publishes: data, a chart, a page, and runs of MLflow
write         writes a publication into a folder
page          parts that all pages have
statistics    the interval of a paired difference
words         what a user picks by words
edge_case_trial   the paper's edge cases of grouping, tried in every way
"""
