import re

import pandas as pd

from aug3d_core.domes.files import DOME_TABLE
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.rendering.files import RENDER_TABLE
from aug3d_core.report.sections.virtual import virtual_views
from tests.report.made_up_run import record, run_of

REASONS = ("inside", "under", "too_near", "aim_hidden", "empty", "back_faces", "black", "smeared")
FIGURES = {
    "views_planned": 4, "domes": 2, "cameras_tried": 20, "reach_share": 0.5, "photos_reach_share": 0.25,
    **{f"rejected_{reason}": 0 for reason in REASONS}, "rejected_empty": 5, "rejected_smeared": 1,
}  # fmt: skip


def place(views: int, why: str) -> dict:
    return {
        "dome_id": 0 if views else -1, "x": 1.0, "y": 2.0, "z": 0.0, "radius": 3.0, "cell": 4.0, "views": views, "why": why,
        "tried": 10, **{f"rejected_{reason}": FIGURES[f"rejected_{reason}"] for reason in REASONS},
    }  # fmt: skip


def drawn(folder) -> str:
    passed = [f"cell of 4, passed over: surface under {share} % of the view" for share in (80, 81.5)]
    other = "cell of 4, passed over: of 72 cameras tried 0 can be used; most others: smeared"
    whys = [*passed, other, "cell of 4: surface under 99 % of the view; left out: adds too little"]
    rows = [place(2, "cell of 4: surface under 95 % of the view"), place(2, "<b>"), *(place(0, why) for why in whys)]
    pd.DataFrame(rows).to_parquet(folder / DOME_TABLE)
    kept = {"view_id": [0, 1, 2, 3], "kept": [True, True, False, True], "reason": ["", "", "black", ""]}
    pd.DataFrame(kept).to_parquet(folder / RENDER_TABLE)
    return virtual_views(
        run_of(
            [
                (Step(STAGES["sampling"]), record("sampling", metrics=FIGURES), folder),
                (Step(STAGES["rendering"]), record("rendering", metrics={"kept": 3}), folder),
            ]
        )
    )


def cells(page: str) -> dict[str, str]:
    rows = re.findall(r"<tr><td[^>]*>(.*?)</td><td[^>]*>(.*?)</td>", page)
    return {name: re.sub("<.*?>", "", count) for name, count in rows}


def test_every_camera_that_was_tried_is_accounted_for(tmp_path):
    found = cells(drawn(tmp_path))
    assert found["tried"] == "20" and found["rejected: sees too little surface"] == "5"
    assert found["usable, but add too little"] == "10"  # 20 less 6 rejected and 4 kept
    assert found["<b>kept</b>"] == "3"  # of rendered views; the table comes last


def test_places_are_told_by_reason_without_their_figures(tmp_path):
    found = cells(drawn(tmp_path))
    assert found["rejected: too little surface under the view"] == "2"
    assert found["rejected: adds too little"] == "1"
    assert found["rejected: most cameras (needs finer texture than the photographs have)"] == "1"
    assert found["<b>dome placed</b>"] == "2"


def test_dropped_renders_have_a_reason_and_text_stays_text(tmp_path):
    page = drawn(tmp_path)
    assert cells(page)["dropped: black"] == "1" and "&lt;b&gt;" in page
    assert "25 % by the photographs, 50 % with the virtual views" in page
