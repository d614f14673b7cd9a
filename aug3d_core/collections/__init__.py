"""Collections: many scenes, one model over all of them, judged on places that it never saw.

entry     the content of a file `<home>/collections/<name>.yaml`
files     read, write and remove such files
towns     towns by number, as members of a collection
made      what is made of a collection: data sets, one training, an evaluation of each scene
flights   scenes that show the same ground, found by position and by content
versions  the versions of a collection's model, and which one is published
page      the report of a version
"""
