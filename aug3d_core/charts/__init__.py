"""What people look at: figures of a run, small pictures, the scene report.

scene_metrics  the figures of one run in the shape of metrics.json
flat           the same by `stage.name`, with the settings, for MLflow and comparisons
comparison     runs beside each other: what differs, and which is better
pooled         the figures of a test that was made in folds
thumbnails     small copies of pictures
html           text to HTML: escaping, numbers, tables, embedded pictures
svg            bars with intervals and curves as inline SVG that follow the page's colours
histogram      the same: how often each size comes
top_view       the scene from above: what a map shows, and the ground under it
ground         how many photographs see each piece of ground
report         one self-contained HTML page per run, with its style, its script and its sections
"""
