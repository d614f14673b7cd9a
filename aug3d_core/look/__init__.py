"""A first look at a folder of photographs, seconds after the flight and before any processing.

glance      one photograph: its header, how sharp and how bright it is, and its features
neighbours  what two photographs that were taken one after the other have in common
ground      positions in metres, the ground that each photograph shows, and how many show a place
control     a list of ground control points, if there is one
cost        what the factory will take for the folder on this machine
findings    what is wrong with the photographs, and what to do
survey      all of it for a folder
page        one HTML file
"""
