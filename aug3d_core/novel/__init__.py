"""The stages of the command `aug3d predict`: a view that no photograph shows; photographs that nobody has seen before.

config   which view, from which photographs
preview  the stage `preview`: photographs with poses -> views and a flight, with a model of other places
stage    the stage `prediction`: predict, draw, report
inputs   which photographs a view is predicted from (numpy, torch)
views    what the settings leave open: inputs, camera; and what of the view the inputs show (numpy)
outside  posed photographs from outside -> a scene
posed    one of them, with its mask (numpy)
"""
