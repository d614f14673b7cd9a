"""PixelNeRF in plain torch: novel views of places it never saw, from a few posed photographs. The only door to torch.

config            the network, how it is trained, how it is judged
rays              packed views -> rays, cut to the slab (numpy)
batch             groups -> what one training step sees (numpy)
cameras           points -> pixels of the input views
encoder           input photographs -> feature maps
field             a point and what the input views show there -> colour and density
sampling          where along a ray to look
compositing       colours and densities along a ray -> one pixel
model             all of it: rays + input views -> pixels, coarse and fine
checkpoint        weights and training state on disk
training          the training loop;   training_stage    the stage `training`
prediction        a whole view;        evaluation        scores, groups, intervals
baselines         the cheap answers (numpy)
panels            pictures to look at
evaluation_stage  the stage `evaluation`
"""
