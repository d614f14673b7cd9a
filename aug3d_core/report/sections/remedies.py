"""What helps where a check of a scene is not good, by check.

Names with a capital, such as Cameras, are sections of the report.
"""

from __future__ import annotations

REMEDIES = {
    "pose": "Cameras lists the photographs without a pose. Take out those of other places and blurred ones, and fly so that"
    " neighbours overlap by 75 %.",
    "error": "Use photographs of one camera with fixed zoom and focus, and none that show what moves.",
    "gps": "Do not measure lengths: GPS disagrees with the photographs (Cameras). aug3d look DIR names positions that cannot be"
    " right.",
    "no gps": "If lengths in metres or a map on earth are wanted, use photographs with GPS.",
    "ground": "Fly again over the ground that few photographs see (Overlap): 75 % overlap along lines, 65 % between them.",
    "groups": "Use smaller groups (--set grouping.k=N), or --preset auto, which chooses their size.",
    "holes": "Add photographs about the held-out ground (Map), or expect holes there: forest and water are holes in any mesh.",
    "renders": "Virtual views tells why renders were left out: mostly for holes of the mesh, which more overlap fills.",
    "leaks": "Do not quote the score before the check that failed is understood (Data set).",
    "views": "Try --preset auto. More photographs help most: aug3d advise SCENE tells from where.",
    "undecided": "Nothing is decided: more held-out photographs would decide it.",
    "simpler": "Use the simpler answer.",
}
