import pandas as pd

from aug3d_core.heads.config import title_of
from aug3d_core.judging.summary import CHEAP
from aug3d_core.report.sections import answers


def test_no_two_answers_of_a_table_have_the_same_name():
    views = pd.DataFrame({name: [20.0] for name in ("psnr", *(f"{cheap}_psnr" for cheap in CHEAP))})
    for head in ("sweep", "pixelnerf"):
        names = [answers._called(name, title_of(head)) for name in answers._answers(views)]
        assert len(set(names)) == len(names) == 1 + len(CHEAP)
