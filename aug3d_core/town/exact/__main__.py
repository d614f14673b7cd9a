"""Replay a stage of this package: `python -m` this package with the path of a job.json."""

from aug3d_core.run.stage_main import main

main()
