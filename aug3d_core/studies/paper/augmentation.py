"""The paper's second table: real photographs, virtual views, and both; and how many virtual views.

Every arm outside the sweep has as many virtual views as training photographs, whatever K and the placement, so that arms
differ in one thing only. Training draws a virtual group with the share that virtual views have of all views.
"""

from __future__ import annotations

from dataclasses import replace

from aug3d_core.studies.paper.arm import Ordering, PaperArm, PaperTable, nothing_more

SIZES = ("20", "10", "auto")
PLACED = {"grid": "grid", "semantic": "buildings", "spiral": "spiral"}  # the paper's name -> the sampling method
SHARES_PCT = (0, 25, 50, 100, 200)
_DATA, _SHARES = "Real photographs, virtual views, and both", "How many virtual views (real + grid, K 10)"
_SWEPT = "10"
_DEPTHS_AT, _DEPTHS_OF = ("20", "10"), ("real", "real + grid")  # where the same is tried without depth


def augmentation_table(quick: bool) -> PaperTable:
    """Return the table; quick: real, virtual and both at one K."""
    sizes = ("auto",) if quick else SIZES
    data = ("real", "grid", "real + grid") if quick else (
        "real", "grid", "semantic", "real + grid", "real + semantic", "real + spiral",
    )  # fmt: skip
    arms = [_trained_on(name, k) for k in sizes for name in data]
    if not quick:
        arms += [
            _without_depth(arm) for arm in arms if arm.labels["K"] in _DEPTHS_AT and arm.labels["data"] in _DEPTHS_OF
        ]
    shares = (0, 100) if quick else SHARES_PCT
    arms += [_swept(share) for share in shares]
    return PaperTable(
        "augmentation",
        "Do virtual views help a model to predict real photographs?",
        tuple(arms),
        nothing_more,
        _orderings(sizes, data),
    )


def _without_depth(arm: PaperArm) -> PaperArm:
    """Return an arm whose model is taught colours alone; heads that are taught no depth have none."""
    labels = {**arm.labels, "data": f"{arm.labels['data']}, no depth taught"}
    name = key(labels["data"], labels["K"])
    return replace(arm, name=name, labels=labels, settings=(*arm.settings, "training.head.depth_weight=0"))


def key(data: str, k: str) -> str:
    """Name an arm."""
    return f"{data}, K {k}"


def _trained_on(data: str, k: str) -> PaperArm:
    real, _, placed = data.rpartition(" + ")
    labels = {"data": data if data == "real" or real else f"{data} alone", "K": k}
    grouped = (f"grouping.k={k}", "grouping.method=shared")
    if data == "real":
        return PaperArm(key(data, k), labels, (*grouped, *_drawn(0.0)), 0.0, _DATA, key("real", k))
    return PaperArm(
        key(data, k), labels, (*grouped, *_placed(placed), *_drawn(0.5 if real else 1.0)), 1.0, _DATA, key("real", k)
    )


def _swept(share_pct: int) -> PaperArm:
    share = share_pct / 100
    settings = (f"grouping.k={_SWEPT}", "grouping.method=shared", *_drawn(share / (1 + share)))
    settings += _placed("grid") if share else ()
    return PaperArm(
        _share(share_pct), {"data": f"real + {share_pct} % grid", "K": _SWEPT}, settings, share, _SHARES, _share(0)
    )


def _share(share_pct: int) -> str:
    return f"{share_pct} % virtual"


def _placed(placed: str) -> tuple[str, str]:
    return f"sampling.method={PLACED[placed]}", "sampling.min_gain=0"  # as many domes as are asked for


def _drawn(share: float) -> tuple[str]:
    return (f"training.rendered_share={share:.4g}",)


def _orderings(sizes: tuple[str, ...], data: tuple[str, ...]) -> tuple[Ordering, ...]:
    found = [
        Ordering(
            f"Real + {placed} is better than real alone (K {k})",
            ((key(f"real + {placed}", k), key("real", k)),),
            paper=k == "20" and placed != "spiral",
        )
        for k in sizes
        for placed in PLACED
        if f"real + {placed}" in data
    ]
    found += [
        Ordering(
            f"Real + semantic is better than real + grid (K {k})",
            ((key("real + semantic", k), key("real + grid", k)),),
            paper=k == "20",
        )
        for k in sizes
        if "real + semantic" in data
    ]
    if {"10", "20"} <= set(sizes):
        found += [
            Ordering(
                f"{data.capitalize()} is better where depth is taught (K {k})",
                ((key(data, k), key(f"{data}, no depth taught", k)),),
                paper=False,
            )
            for data in _DEPTHS_OF
            for k in _DEPTHS_AT
        ]
        found.append(
            Ordering(
                "Real alone at K 10 is better than real + grid or real + semantic at K 20",
                tuple((key("real", "10"), key(f"real + {placed}", "20")) for placed in ("grid", "semantic")),
                paper=True,
            )
        )
    return tuple(found)
