"""A model that sees geometry: it sweeps planes through the slab, and blends the inputs' pixels where they agree.

config         its settings, and how it is trained in each preset
head           loss and prediction: what training and judging see
start          its first weights: of the model in towns/, which is shipped, or of a file
named_weights  a look at such a file before a run
disguise       a training step in other colours, and as by other cameras
network        features -> coarse and fine cost volumes -> depth -> blended colours
"""
