"""The paper's tables: the same scene made and judged in several ways, which differ in one thing at a time.

arm            the arms of a table, and the orderings that it tests
scene          the finished scene that a study starts from
effort         how long every run is trained
cell           one run of an arm: a seed in a fold
tables         every cell of a table, and the table's findings
scores         the scores of cells, photograph by photograph; they must be of the same test
orderings      differences between arms, and whether an ordering holds
rows           a row per arm
grouping, augmentation   the paper's two tables
findings       the findings as data
chart, page    the study as a picture, and as a publication
"""
