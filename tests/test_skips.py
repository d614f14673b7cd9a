"""A skip that nobody expects fails the run of CI."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.tests_support import run_pytest

PHOTOS, CHROMIUM = "the real photo sets are not at /somewhere", "Debian's chromium is not installed"


def run(folder: Path, reason: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Run a test that is skipped, and one that passes."""
    (folder / "test_it.py").write_text(
        f"import pytest\ndef test_well(): pass\ndef test_skipped(): pytest.skip({reason!r})\n"
    )
    return run_pytest(folder, "tests.skips", *options)


@pytest.mark.parametrize(
    ("reason", "options", "code"),
    [
        (PHOTOS, ("--strict-skips",), 0),
        (CHROMIUM, ("--strict-skips",), 1),
        (CHROMIUM, ("--strict-skips", "-n", "2"), 1),
        (CHROMIUM, ("--strict-skips", "--may-skip", "Debian's chromium"), 0),
        (CHROMIUM, (), 0),
    ],
)
def test_the_exit_code_says_whether_a_skip_was_expected(
    reason: str, options: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    done = run(tmp_path, reason, *options)
    assert done.returncode == code, done.stdout + done.stderr
    assert (f"1 UNEXPECTED {reason}" in done.stdout) == (code == 1)
    assert "1 skipped" in done.stdout
