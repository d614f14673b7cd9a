"""The stage's own process: `python -m aug3d_core.<package> job.json` runs what the factory ran.

The job's folder receives `files/` (the output), `outcome.json` or `error.json`, and `progress.json` while it works.
"""

from __future__ import annotations

import faulthandler
import json
import os
import sys
import time
import traceback
from contextlib import suppress
from pathlib import Path
from typing import get_type_hints

from pydantic import BaseModel

from aug3d_core.run.atomic_file import write_synced
from aug3d_core.run.errors import Aug3dError
from aug3d_core.run.files import ERROR, FILES, OUTCOME, PROGRESS
from aug3d_core.run.full_disk import disk_full
from aug3d_core.run.helper_process import WorkerDied
from aug3d_core.run.linux_process import SUPERVISED, call_this_process, die_with_parent
from aug3d_core.run.stage import stage_function

_PROGRESS_PERIOD_S = 0.2


class Job(BaseModel):
    """The work of a stage's process; JSON beside the output. entry: "module:function" of the stage function."""

    stage: str
    entry: str
    config: dict
    inputs: dict[str, Path]


def main() -> None:
    """Run the job named on the command line; exit code 0, or 1 with `error.json`, or the error number that kept it out."""
    if len(sys.argv) != 2 or sys.argv[1] in ("-h", "--help"):
        print("usage: python -m aug3d_core.<package> job.json\n\nRun one stage again, exactly as the factory ran it.")
        sys.exit(0 if "-h" in sys.argv[1:2] or "--help" in sys.argv[1:2] else 2)
    if SUPERVISED in os.environ:
        die_with_parent()
    faulthandler.enable()
    job_file = Path(sys.argv[1]).resolve()
    try:
        run_job(Job.model_validate_json(job_file.read_bytes()), job_file.parent)
    except Exception as error:
        with suppress(OSError):  # the log is on the same disk
            traceback.print_exc()
        try:
            write_synced(job_file.parent / ERROR, json.dumps(_described(error)).encode())
        except OSError as unwritten:
            sys.exit(unwritten.errno)  # that of a full disk says so
        sys.exit(1)


def run_job(job: Job, folder: Path) -> None:
    """Run the stage function and write its outcome."""
    call_this_process(f"aug3d {job.stage}")
    function = stage_function(job.entry)
    config = get_type_hints(function)["config"].model_validate(job.config)
    out = folder / FILES
    out.mkdir(exist_ok=True)
    outcome = function(job.inputs, config, out, _progress_writer(folder))
    write_synced(folder / OUTCOME, outcome.model_dump_json().encode())


def _described(error: Exception) -> dict[str, str]:
    if disk_full(error):
        return {"cause": "disk", "problem": str(error), "remedy": ""}
    if isinstance(error, WorkerDied):
        return {"cause": error.cause, "problem": error.problem, "remedy": error.remedy}
    if isinstance(error, Aug3dError):
        return {"cause": "refused", "problem": error.problem, "remedy": error.remedy}
    if isinstance(error, MemoryError):
        return {"cause": "memory", "problem": "out of memory", "remedy": "use a smaller preset or fewer photographs"}
    return {
        "cause": "error",
        "problem": f"{type(error).__name__}: {error}",
        "remedy": "read the log, then run the replay command",
    }


def _progress_writer(folder: Path):
    last = 0.0

    def progress(done: int, total: int, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _PROGRESS_PERIOD_S or done >= total:
            last = now
            temporary = folder / f".{PROGRESS}"
            with suppress(OSError):  # a full disk ends the work itself
                temporary.write_text(json.dumps({"done": done, "total": total, "what": what}))
                temporary.replace(folder / PROGRESS)

    return progress
