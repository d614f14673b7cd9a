"""What a run will take on this machine, before it starts: time, memory and disk, as ranges.

laws         how each stage grows with the scene and its settings
size         how large a scene is
likely       the settings that a run is likely to have, where they are decided from the scene
calibration  how this machine differs from the one that the laws were measured on
estimate     what the steps of a run will take
room         refuse a run that does not fit
cost         ranges
"""
