"""Studies: the same scene made and judged in several ways, which differ in one thing at a time.

arm            one way, and what is a study: arms, and the orderings that it tests
scene          the finished scene that a study starts from
effort         how long every run is trained
cell           one run of an arm: a seed in a fold; made through the store, so that a killed study goes on where it was
run            every cell of a study
scores         what cells say, view by view, and that all were given the same test
statistics     intervals of paired differences, and whether an ordering holds
table          a row per arm
grouping, augmentation   the paper's two tables
findings       all of it as data
chart, page, write   the study as a picture, as a page, and as a folder
"""
