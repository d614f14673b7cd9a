"""A finished scene in a browser: its points, mesh and cameras, and what its model predicts wherever the camera goes.

finished   what is read of a scene
viewer     the page that shows it, by viser
server     viser's server, which lets nobody in without a token
layers     what stands in the three-dimensional scene
colours    the colours of cameras
poses      poses between browser and project, and a path through some
inputs     which photographs a view is predicted from
predictor  a loaded model that predicts at a pose (torch)
latest     a thread that does what was asked last
film       a path as a film of predictions
pictures   what the panel shows of a prediction and of a photograph
markdown   words of others, safe to show
"""
