"""Stability: every method at the place where it breaks, and whether the factory notices.

perturbation   what is done to the factory, in which doses, to which methods, and the mark below which one counts as broken
perturbations/, catalogue   all of them, a module for each chapter of the page
world, learning_world   the small towns that most cells run on, and what cells that train add to them
spoils/        the damages
positions_off, alignment, ground_models   GPS and land on worlds that are known exactly
edge_cases, box_world, box_finder   the paper's edge cases of grouping, and villages, known exactly too
config, spoil_stage, compute_stage   the two stages that the study adds: one damages, one computes on exact worlds
cell, run      a perturbation at a dose, a method, a seed -> accuracy, cost, and the state the factory reported
findings       breaking doses, silent failures, alarms without cause
map, pictures, edge_story, page, write   what people look at
"""
