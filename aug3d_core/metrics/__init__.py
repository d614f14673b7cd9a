"""The figures of a run: `metrics.json`, figures by name, figures over all folds, and comparison of runs."""
