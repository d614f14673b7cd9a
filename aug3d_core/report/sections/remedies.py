"""What helps where a check of a scene is not good, by check.

Names with a capital, such as Cameras, are sections of the report; what stands in backquotes is typed.
"""

from __future__ import annotations

import re
from html import escape

from aug3d_core.factory.config import AUTO
from aug3d_core.report.html import tag
from aug3d_core.report.reported_run import ReportedRun

_REMEDIES = {
    "pose": "Cameras lists the photographs without a pose. Take out those of other places and blurred ones, and fly so that"
    " neighbours overlap by 75 %.",
    "error": "Use photographs of one camera with fixed zoom and focus, and none that show what moves.",
    "gps": "Do not measure lengths: GPS disagrees with the photographs (Cameras). `aug3d look DIR` names positions that cannot"
    " be right.",
    "no gps": "If you want lengths in metres or a map on earth, use photographs with GPS.",
    "ground": "Fly again over the ground that few photographs see (Overlap): 75 % overlap along lines, 65 % between them.",
    "groups": "Use smaller groups: `--set grouping.k=N`.",
    "holes": "Add photographs about the held-out ground (Map), or expect holes there: forest and water are holes in any mesh.",
    "renders": "Virtual views lists why renders were left out. Most often the mesh has holes, which more overlap fills.",
    "leaks": "Do not quote the score before the check that failed is understood (Data set).",
    "views": "More photographs help most. `aug3d advise {scene} DIR` says from where.",
    "undecided": "Nothing is decided: more held-out photographs would decide it.",
    "simpler": "Use the simpler answer.",
}
_BESIDE_AUTO = {"groups": " `--preset auto` chooses their size.", "views": " Try `--preset auto`, too."}


def remedy(check: str, run: ReportedRun) -> str:
    """Return what helps this scene; it is not told to use what it uses already."""
    said = _REMEDIES[check].format(scene=run.metrics["scene"])
    return said if run.metrics.get("preset") == AUTO else said + _BESIDE_AUTO.get(check, "")


def as_html(said: str) -> str:
    """Return a text whose backquotes stand about what is typed."""
    return re.sub("`([^`]*)`", lambda typed: tag("code", typed[1]), escape(said))
