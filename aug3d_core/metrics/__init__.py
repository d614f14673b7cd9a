"""The figures of a run, over all folds, and runs beside each other.

scene_metrics  the figures of a run as `metrics.json` has them
flat           the same by `stage.name`
pooled         a test that was made in folds, as one
comparison     which settings and figures of runs differ, and which is better
"""
