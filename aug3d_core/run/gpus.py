"""The NVIDIA GPUs of this machine, as its driver tells them: known without torch, which takes seconds to import."""

from __future__ import annotations

import shutil
import subprocess

_PATIENCE_S = 30  # a driver that sleeps takes seconds to answer


def gpu_names() -> list[str]:
    """Return the name of each GPU; none where there is no driver, or it does not answer."""
    program = shutil.which("nvidia-smi")
    if program is None:
        return []
    words = [program, "--query-gpu=name", "--format=csv,noheader"]
    try:
        told = subprocess.run(words, capture_output=True, text=True, timeout=_PATIENCE_S, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return []
    return [line.strip() for line in told.splitlines() if line.strip()]
