"""A process that the factory started ends with it, and with nothing else."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from aug3d_core.run.linux_process import SUPERVISED

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="the kernel ends a process with its parent on Linux alone"
)
_CHILD_OF_NUMBER_1 = """
import os
os.getppid = lambda: 1
from aug3d_core.run.linux_process import die_with_parent
die_with_parent()
"""


@pytest.mark.parametrize(("parent", "code"), [(4242, 1), (1, 0)])
def test_number_1_takes_orphans_but_may_be_the_parent_itself_in_a_container(parent: int, code: int) -> None:
    environment = {**os.environ, SUPERVISED: str(parent)}
    assert subprocess.run([sys.executable, "-c", _CHILD_OF_NUMBER_1], env=environment, timeout=60).returncode == code
