"""Stands in for the worker: runs a little flow and logs an MLflow run for every file that a test puts into its folder."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from mlflow.tracking import MlflowClient
from prefect import flow

from flows.services import tell_ready


@flow(name="little")
def little(name: str) -> str:
    """Log one run of that name, and return its id."""
    client = MlflowClient()
    return client.create_run("0", run_name=name).info.run_id


def main() -> None:
    """Work until killed."""
    wishes = Path(sys.argv[1])
    tell_ready(Path(os.environ["AUG3D_HOME"]))
    while True:
        for wish in wishes.glob("*.wish"):
            little(wish.stem)
            wish.rename(wish.with_suffix(".done"))
        time.sleep(0.1)


if __name__ == "__main__":
    main()
