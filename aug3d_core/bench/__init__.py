"""Measure again, on this machine, the figures that the issues, the README and the docs quote.

figure, machine   a figure with its goal, and what it was measured on
geometry, orthophoto, cloud   poses, depth, mesh, map and points of the town against its truth
tiles, fusion_tiles, borders   its surface and fusion in several tiles of ground, against those in one; near borders too
grouping, coverage, buildings, city   which photographs belong together, and where domes stand
rendering, render_speed, raycasting   what Cycles costs
heads, scores, nerf, generalisation   the models against the cheap answers, each other, and places never seen
gpu, gpu_job   what a CUDA GPU adds
look, advice, spoiled, spoiled_flights, view   what pilots meet
scale, big_scene, growing   growth with the number of photographs, at once and a tenth more
machines, workers, team, s3_service, small_town   more than one machine
"""
