"""Speed against accuracy: what every setting of the factory costs and gains, and the cheapest configuration that is enough.

setting        the settings and values that are tried, with the stages whose time counts and the figure that judges them
scene          the scene: the built-in town, one of the registry, or one with a finished run
arm            one way to make a scene, and its results
plan           the arms: setting by setting, and the grid over the whole factory
run            makes cells in a random order
point          time and accuracy of an arm: medians over seeds, the front, the cheapest that reaches a target
search         successive halving towards the cheapest configuration that reaches a target, without trying everything
study          the whole study on one scene
findings       the findings as data
chart, page    the study as charts, and as a publication
"""
