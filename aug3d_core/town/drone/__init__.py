"""Fly over the town: the path, the camera's faults, GPS, and the JPEG with EXIF."""
