"""Photographs out of a drone's films: what `aug3d frames` does.

subtitles  where the drone was, as its subtitles tell
choice     which frames are kept: sharp ones, that overlap well
taken      the chosen frames as JPEG files with time and place
"""
