"""A finished scene in a browser: its points, mesh and cameras, and what its model predicts wherever the camera goes.

`finished` reads a scene, `predictor` predicts at a pose, `viewer` shows both by viser, which `server` lets nobody into without
a token.
"""
