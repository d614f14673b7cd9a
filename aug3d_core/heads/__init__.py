"""View-synthesis models behind one protocol. A head is a folder here, and is found by the folder's name.

config     the settings of a head, and how it is found by its name (no torch)
head       the protocol: loss, symptoms, prediction; and the predicted View
saved      a trained head on disk
exposure   one brightness and contrast for the inputs of a group
pixelnerf  the paper's model
sweep      a model that sees geometry

A head NAME has `NAME/config.py` with CONFIG and PRESETS, and `NAME/head.py` with HEAD. Others reach it by its name alone.
"""
