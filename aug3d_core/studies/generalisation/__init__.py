"""The study of generalisation: how good is a model on a place that it never saw?

Every scene of a collection is left out in turn. A model is trained on all others, and judged on it as it is; tuned on it; and
held against one that was trained on it alone, for ten times the steps of the tuning.

cells     what is trained for each scene, and judged
findings  scores with paired leads over the cheap answers, and over each other
page      chart and page
"""
