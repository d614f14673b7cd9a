"""How a stage is executed: what a stage is, its process, limits, progress, errors and files.

stage           configuration, inputs, function and outcome of a stage
metric          what the figures of a stage mean
nested          settings within settings, by a path of names
stage_main      what the stage's own process does: `python -m aug3d_core.<package> job.json`
process         run a job in a process group with a log, a time limit and a memory limit
limits          these limits, as the environment tells them
fork_server     start stages quickly, from a server process with the common libraries
helper_process  workers of a stage, such as Blender, one job each
linux_process   end a process when its parent ends
beside          work beside other work, in a thread
progress        progress reports from a thread of their own
garbage         when Python looks for garbage
memory          the memory of the machine or container
memory_meter    the memory of a job
gpus            the NVIDIA GPUs of the machine
errors          errors with problem and remedy
full_disk       a full disk, told from other troubles
files           names of the files of a job
scratch         folders that a stage needs only while it works
atomic_file     files that survive a power cut
digest          SHA-256 of files
regular_file    open what a user named: regular files alone
picture         a user's picture -> 8-bit RGB
stored_archive  zip archives that hold what they say
place_in_exif   write the place into a photograph's EXIF
"""
