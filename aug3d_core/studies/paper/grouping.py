"""The paper's first table: ways of grouping, K, and input views, with real photographs only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from aug3d_core.studies.paper.arm import Ordering, PaperArm, PaperTable

METHODS = ("sequence", "grid", "ray", "shared", "surface")
_PAPERS = ("sequence", "grid", "ray")  # the paper finds shared points better than these
SIZES = ("20", "10", "auto")
INPUTS = (3, 6, 9)
_GROUPS, _INPUTS = "Ways of grouping", "Input views, for the best of them"


def grouping_table(quick: bool) -> PaperTable:
    """Return the table; quick: two ways of grouping at two K."""
    methods, sizes = (("sequence", "shared"), ("10", "auto")) if quick else (METHODS, SIZES)
    arms = tuple(_grouped(method, k) for k in sizes for method in methods)
    inputs = INPUTS[:2] if quick else INPUTS
    return PaperTable(
        "grouping",
        "Which photographs belong in a group, and how many?",
        arms,
        lambda judged: _more_inputs(arms, judged, inputs),
        _orderings(methods, sizes, inputs),
    )


def key(method: str, k: str) -> str:
    """Name an arm."""
    return f"{method}, K {k}"


def _grouped(method: str, k: str) -> PaperArm:
    settings = (f"grouping.method={method}", f"grouping.k={k}", "training.rendered_share=0")
    return PaperArm(
        key(method, k),
        {"method": method, "K": k, "inputs": "3"},
        (*settings, *_inputs(3)),
        0.0,
        _GROUPS,
        key("shared", k),
    )


def _inputs(views: int) -> tuple[str, str]:
    return f"training.input_views={views}", f"evaluation.input_views={views}"


def _more_inputs(
    arms: Sequence[PaperArm], judged: Mapping[str, tuple[float, float]], inputs: Sequence[int]
) -> list[PaperArm]:
    """Return the best arm with more input views. Its groups must be large enough to leave a target."""
    able = [arm for arm in arms if arm.name in judged and judged[arm.name][1] > inputs[-1]]
    if not able:
        return []
    best = max(able, key=lambda arm: judged[arm.name][0])
    grouped = tuple(s for s in best.settings if "input_views" not in s)
    return [
        PaperArm(
            _best(views),
            {**best.labels, "inputs": str(views)},
            (*grouped, *_inputs(views)),
            0.0,
            _INPUTS,
            _best(inputs[0]),
        )
        for views in inputs
    ]


def _best(views: int) -> str:
    return f"the best, {views} inputs"


def _orderings(methods: Sequence[str], sizes: Sequence[str], inputs: Sequence[int]) -> tuple[Ordering, ...]:
    papers = [method for method in methods if method in _PAPERS]
    found = [
        Ordering(
            f"Groups by shared points are better than those by {_listed(papers)} (K {k})",
            tuple((key("shared", k), key(method, k)) for method in papers),
            paper=k == "20",
        )
        for k in sizes
    ]
    if "surface" in methods:
        found += [
            Ordering(
                f"Groups by seen surface are better than those by shared points (K {k})",
                ((key("surface", k), key("shared", k)),),
                paper=False,
            )
            for k in sizes
        ]
    if {"10", "20"} <= set(sizes):
        found += [
            Ordering(
                f"K 10 is better than K 20 ({method})",
                ((key(method, "10"), key(method, "20")),),
                paper=method == "shared",
            )
            for method in methods
        ]
    found.append(
        Ordering(f"{inputs[0]} input views are better than {inputs[-1]}", ((_best(inputs[0]), _best(inputs[-1])),))
    )
    return tuple(found)


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"
