"""What a section of the report reads: the records and files of a run, as one fold has them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int, UInt8

from aug3d_core.depth.files import BASELINE_FUSED
from aug3d_core.factory.plan import later_folds
from aug3d_core.factory.stages import STAGES
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.metrics.scene_metrics import Made
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.report.ground_coverage import enclosed, overlap_frame, seen_by
from aug3d_core.report.html import PICTURE_PX, picture
from aug3d_core.report.reads import is_read
from aug3d_core.report.top_view import Frame, frame_of, from_above
from aug3d_core.run.stage import Metric
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS, WORLD
from aug3d_core.store.record import Record

_MAP_PX = 1000
_LATER_FOLD_PX = 720


@dataclass(frozen=True)
class ReportedRun:
    """A complete or failed run: its objects and the content of its `metrics.json`; `fold` is the current fold."""

    made: Made
    metrics: Mapping[str, Any]
    fold: int = 0

    def in_fold(self, fold: int) -> ReportedRun:
        """Return the run as another fold has it."""
        return replace(self, fold=fold)

    @property
    def folds(self) -> int:
        """The number of folds with results."""
        return 1 + max((step.fold for step, _, _ in self.made), default=0)

    def record(self, stage: str) -> Record | None:
        """Return the record of a stage; None if this fold has none."""
        return self._seen[stage][0] if stage in self._seen else None

    def metric(self, stage: str, name: str) -> Metric:
        """Return a metric of a stage; None if there is none."""
        record = self.record(stage)
        return record.metrics.get(name) if record else None

    def figure(self, stage: str, name: str) -> float | None:
        """Return a metric of a stage as a number; None if there is none."""
        value = self.metric(stage, name)
        return float(value) if isinstance(value, int | float) else None

    def file(self, stage: str, name: str) -> Path | None:
        """Return a file of a stage; None if it does not exist."""
        if stage not in self._seen:
            return None
        record, folder = self._seen[stage]
        assert is_read(record, name), f"report/reads.py does not list {name} of {stage}"
        return folder / name if (folder / name).is_file() else None

    def table(self, stage: str, name: str) -> pd.DataFrame:
        """Return a table of a stage; empty if it does not exist."""
        path = self.file(stage, name)
        return pd.read_parquet(path) if path else pd.DataFrame()

    def pictures(self, stage: str) -> str:
        """Return the pictures of a stage; those of later folds are small, to keep the page small."""
        record, shown = self.record(stage), ""
        for caption, name in (record.pictures if record else {}).items():
            path = self.file(stage, name)
            shown += picture(path, caption, _LATER_FOLD_PX if self.fold else PICTURE_PX) if path else ""
        return shown

    @cached_property
    def views(self) -> Views | None:
        """The photographs with a pose."""
        path = self.file("sfm", VIEWS)
        return Views.load(path) if path else None

    @cached_property
    def points(self) -> Points | None:
        """The points of the reconstruction."""
        path = self.file("sfm", POINTS)
        return Points.load(path) if path else None

    @cached_property
    def tracks(self) -> Tracks | None:
        """Which photograph sees which point."""
        path = self.file("sfm", TRACKS)
        return Tracks.load(path) if path else None

    @cached_property
    def frame(self) -> Frame | None:
        """The extent of the maps: every camera, and nearly all points."""
        if self.views is None:
            return None
        xy = self.points.xyz[:, :2] if self.points is not None else np.zeros((0, 2))
        return frame_of(xy, centres(self.views.cam_from_world)[:, :2], _MAP_PX)

    @cached_property
    def ground(self) -> tuple[Float[np.ndarray, "p 3"], UInt8[np.ndarray, "p 3"]]:
        """Positions and colours of the surface: fused points, or else the points of the reconstruction."""
        fused = self.file("depth", BASELINE_FUSED)
        if fused:
            with np.load(fused, allow_pickle=False) as arrays:
                return arrays["xyz"].astype(float), arrays["rgb"]
        if self.points is None:
            return np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
        return self.points.xyz, self.points.rgb

    @cached_property
    def seen_by(self) -> Int[np.ndarray, "h w"] | None:
        """How many photographs see each piece of the mapped ground; -1 where no surface is known."""
        return seen_by(*self._mapped, self.views) if self._mapped and self.views is not None else None

    @cached_property
    def enclosed(self) -> Bool[np.ndarray, "h w"]:
        """Which pieces of the mapped ground of `seen_by` the flight encloses."""
        assert self._mapped and self.views is not None, "seen_by is None"
        return enclosed(*self._mapped, self.views)

    @cached_property
    def _mapped(self) -> tuple[Float[np.ndarray, "h w"], Frame] | None:
        if self.views is None or self.frame is None:
            return None
        coarse = overlap_frame(self.frame, len(self.views))
        return from_above(*self.ground, coarse)[1], coarse

    @cached_property
    def unit(self) -> str:
        """The unit of lengths."""
        world = self.file("sfm", WORLD)
        return str(json.loads(world.read_text())["unit"]) if world else "scene unit"

    @cached_property
    def names(self) -> Mapping[int, str]:
        """The name of each photograph by its id."""
        table = self.table("photos", PHOTO_TABLE)
        return dict(zip(table["photo_id"], table["name"], strict=True)) if len(table) else {}

    def called(self, photo_id: int) -> str:
        """Return a photograph's id and name, as plain text."""
        return f"{photo_id} {self.names.get(photo_id, '')}".strip()

    @cached_property
    def _seen(self) -> dict[str, tuple[Record, Path]]:
        records = {step.name: record for step, record, _ in self.made}
        folded = {step.stage.name for step in later_folds(STAGES.values(), records)}
        return {
            step.stage.name: (record, folder)
            for step, record, folder in self.made
            if step.fold == (self.fold if step.stage.name in folded else 0)
        }
