"""Speed against accuracy: what every setting of the factory costs, what it gains, and the cheapest way to enough.

setting        what is tried: settings and values, with the stages that pay for them and the figure that tells what they buy
scene          what it is tried on: the built-in town, a scene of the registry, or a scene with a finished run
arm            one way to make a scene, as far as its figure needs
plan           the arms: setting by setting, and the grid over the whole factory
run            makes arms in an order drawn by lot, each with several seeds; a killed study goes on where it was
point          time and accuracy of an arm: medians over seeds, the front, the cheapest that reaches a target
search         successive halving towards the cheapest configuration that reaches a target, without trying everything
study          all of it on one scene
findings, page, write   the study as data, as a page with charts, and as a folder
"""
