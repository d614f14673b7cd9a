"""Which photographs to take next, and files that take them: what `aug3d advise` does.

plan         a finished scene -> the advice, as files
site         the ground that a flight is about: places on it, how high it is flown safely
model_error  where the model errs, laid on the ground
need         how well each place is seen, from how many sides, and where the model errs
choice       the photographs that make up for most of what is missing, one after another
route        their order in the air
mission      files for the field: DJI's WPML, KML, GeoJSON, a table
page         the advice on a map
written      these files in one folder
"""
