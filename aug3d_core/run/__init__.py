"""How a stage is executed: what a stage is, its process, limits, progress, errors and files.

stage           configuration, inputs, function and outcome of a stage
stage_main      what the stage's own process does: `python -m aug3d_core.<package> job.json`
process         run a job in a process group with a log, a time limit and a memory limit
fork_server     start stages quickly, from a server process with the common libraries
helper_process  workers of a stage, such as Blender, one job each
linux_process   end a process when its parent ends
progress        progress reports from a thread of their own
memory          the memory of the machine or container
errors          errors with problem and remedy
files           names of the files of a job
atomic_file     files that survive a power cut
digest          SHA-256 of files
"""
