"""Turn a folder of photographs into a checked table and working copies.

discover       which files are photographs, their order by name, and the digest of the folder
digest_apart   that digest, read by a process of its own
exif           focal length, position, time and orientation as the camera wrote them
xmp            where a drone's camera looked, and how high it was, as the drone wrote them
decode         one file to one working copy, or the reason why not
masks          what of each photograph is not to be used
foreign        pictures that no camera took
redundant      photographs that show what the one before them shows (OpenCV)
control        ground control points and where photographs show them, from a gcp_list.txt
table          the photo table and the table of rejected files
contact_sheet  a picture of what was taken in
stage          the stage
"""
