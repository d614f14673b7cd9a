"""The files in the folder of a job."""

from __future__ import annotations

FILES = "files"
JOB = "job.json"
LOG = "log.txt"
OUTCOME = "outcome.json"
ERROR = "error.json"
PROGRESS = "progress.json"
SPENT = "spent.json"
EARLIER = "earlier"
