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
step, run         one step of it, and its state;           schedule    learning rates, and when it is enough
watch             is training alive? (numpy);              team        several processes that train one model
prediction        a whole view;        evaluation        scores of every test view
summary           scores -> means, groups, intervals, of one fold or several (numpy)
baselines         the cheap answers (numpy)
conventions       how answers are scored, stated once, with a digest
panels            pictures to look at
flythrough        a short flight around a test view
evaluation_stage  the stage `evaluation`
novel             a view that no photograph shows: inputs, camera, what is seen (numpy)
outside           posed photographs from outside -> a scene (numpy)
prediction_stage  the stage `prediction`, of the command `aug3d predict`
"""
