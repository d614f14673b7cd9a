"""A scene's groups for the original pixelNeRF code: written, and how to go on with them."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

_SAME_CAMERA_PX = 0.5


def export_groups(dataset: Path, folder: Path, as_json: bool) -> None:
    """Write the groups in the DTU layout, and tell it."""
    from aug3d_core.export.dtu import export_dtu  # with zarr, which other commands do without

    written = export_dtu(dataset, folder)
    if as_json:
        print(json.dumps({"folder": str(folder), "format": "dtu", **asdict(written)}))
        return
    counts = ", ".join(f"{count} {name}" for name, count in written.scans.items())
    print(f"{counts} scans, a group each, with {written.views} views are in {folder}")
    if written.intrinsics_off_px > _SAME_CAMERA_PX:
        Console().print(
            f"[yellow]note[/] pixelNeRF takes one camera per scan: views are up to {written.intrinsics_off_px:.1f} px off",
            soft_wrap=True,
        )
    print(f"\nnext  python train/train.py -n my_scene -c conf/exp/dtu.conf -D {folder} -V 3   (in pixelNeRF's folder)")
    print(f"      python eval/eval.py -n my_scene -c conf/exp/dtu.conf -D {folder} --split test -P '1 2 3'")
