"""The cache policy: a stage is not run again while its object is in the store, whole and unaltered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from prefect.cache_policies import CachePolicy
from prefect.context import TaskRunContext
from prefect.settings import get_current_settings

from aug3d_core.make import key_of
from aug3d_core.stages import stage_reading
from aug3d_core.store.store import Store


class ObjectCache(CachePolicy):
    """Key a task run by the store's key of its object.

    Prefect's own TASK_SOURCE would hash the text of one thin task and miss every change in `aug3d_core`. Where the object
    is gone or altered, Prefect's memory of it is dropped, so that the hit becomes a miss.
    """

    def compute_key(
        self, task_ctx: TaskRunContext, inputs: dict[str, Any], flow_parameters: dict[str, Any], **_: Any
    ) -> str:
        """Return `<stage>-<key>`; drop a result whose object the store no longer has."""
        stage = stage_reading(inputs["stage"], inputs["sources"])
        key = key_of(stage, inputs["config"], inputs["sources"])
        name = f"{inputs['stage']}-{key}"
        if Store(Path(inputs["home"])).find(inputs["stage"], key) is None:
            (get_current_settings().results.local_storage_path / name).unlink(missing_ok=True)
        return name
