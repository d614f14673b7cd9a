"""The scene report: one self-contained HTML page per run.

scene_report     the page, with its style, its script and its sections
sections         its sections
reported_run     what a section reads: the records and files of a run, as one fold has them
reads            which files those may be
html             escaping, numbers, tables, embedded pictures
svg              bars with intervals and curves, as inline SVG in the page's colours
histogram        histograms, drawn the same way
front            time against accuracy as PNG
front_html       the same, interactive
top_view         the scene from above: the extent of the maps, and the ground below it
ground_coverage  how many photographs see each piece of the ground
story            all studies of one store as a page
thumbnails       small copies of pictures
report_style     the style sheets
report_script    the script of the scene report
"""
