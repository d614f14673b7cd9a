"""Stability: at which dose each method breaks, and whether the factory notices.

perturbation   what is done to the factory, in which doses, to which methods, and the mark past which one counts as broken
perturbations, catalogue   all of them, a module for each chapter of the page
world, learning_world   the small towns that most cells run on, and what cells that train add to them
damages        changes to the output of a stage
positions_off, alignment, ground_models   GPS and terrain on exactly known worlds
edge_cases, box_world, box_finder   the paper's edge cases of grouping, and villages, on exactly known worlds
config, damage_stage, compute_stage   the two stages that the study adds: one damages, one computes on exact worlds
cell           a perturbation at a dose, a method, a seed -> accuracy, cost, and the state that the factory reported
findings       breaking doses, silent failures, alarms without cause
map, pictures, edge_story   charts and pictures
page           the study as a publication
"""
