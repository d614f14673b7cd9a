"""A town with exact truth, flown over by a virtual drone.

generator   the town: plan, terrain, buildings, textures
drone       flight, lens, sensor, GPS, photographs
truth       comparison of reconstructions with the town; small exact worlds
exact       towns packed straight from their truth
stage       the stage `town`, which renders the flight
"""
