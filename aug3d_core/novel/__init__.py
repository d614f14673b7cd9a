"""The stage `prediction`, of the command `aug3d predict`: a view that no photograph shows.

config   which view, from which photographs
stage    the stage: predict, draw, report
views    what the settings leave open: inputs, camera; and what of the view the inputs show (numpy)
outside  posed photographs from outside -> a scene (numpy)
"""
