"""Immutable, content-addressed outputs: records, keys, commit, verification, locks.

layout         the names of folders and files in a home and a shared store
store          objects: made apart, and moved into place whole
keys           what can change a result -> its key
code           the code that a stage runs, as its key sees it
code_version   which commit made a result
changes        why a step has to be made again, in words
record         what made an object, what it holds, what it cost, how good it is
seal           JSON with a digest of itself
timed          folders that are named by the time
scenes         the versions of a scene
scene_name     names that are safe
version_name   how people name a version
published      the version that others use
usage          who needs which objects
retention      what may go, and how
verification   read everything, name what is damaged
damage         damaged files
private_home   the home folder is its owner's alone
bucket         bytes under names at an S3 service
shared         a store that several machines share
cache          the home of a machine as a cache of it
lease          the right of one machine to make a thing
machine_name   how a machine is called among those that share
hand_over      partial files of long work
census         all that is in a shared store
marks, sweep   what may go from it, and how
shared_verification  read all of it, and see that damaged objects are made again
traffic        what was asked of it
"""
