"""What people look at: figures of a run, small pictures, the scene report.

scene_metrics  the figures of one run in the shape of metrics.json, and flat for MLflow
thumbnails     small JPEG copies of pictures
html           text to HTML: escaping, numbers, tables, embedded pictures
svg            bars with intervals and curves as inline SVG that follow the page's colours
report_style   the report's style sheet
report         one self-contained HTML page per run
"""
