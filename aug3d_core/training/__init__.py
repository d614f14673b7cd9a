"""The stage `training`: data sets -> a trained head. Knows the protocol of heads, no head.

config      what a step sees, the optimiser, the head
stage       the stage: train, save, report
loop        the training loop
state       a run under way
ahead       the next batch, read while the present one is learned from
loss_step   a step as one module
schedule    learning rates, and when it is enough
divergence  does training still learn? (numpy)
ddp         several processes that train one head
checkpoint  training state on disk
"""
