"""PixelNeRF in plain torch: the paper's model, from posed photographs to a view along rays.

config           its settings, and how it is trained in each preset
head             loss, symptoms, first weights, prediction: what training and judging see
model            rays and input views -> pixels, coarse and fine
cameras          points -> pixels of the input views
encoder          input photographs -> feature maps
resnet           the paper's encoder
encoder_weights  where its weights come from
named_weights    a look at a file of them before a run
field            a point and what the input views show there -> colour and density
cpu_mlp          blocks of the field in cache-sized parts
sampling         where along a ray to look
compositing      colours and densities along a ray -> one pixel
prediction       a whole view
reference        the paper's network without any saving
speed, speed_job  the two timed
"""
