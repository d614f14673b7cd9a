"""Fly over the town: the path, the camera's faults, GPS, and the JPEG with EXIF.

paths    where photographs are meant to be taken
flight   where they are taken
gps      what the GPS says of it
studio   renders of the town, before lens and sensor
develop  from a render to the JPEG, step by step
lens     radial distortion
sensor   sky, moving water, blur, steps of exposure
photo    noise, and the JPEG with its EXIF
"""
