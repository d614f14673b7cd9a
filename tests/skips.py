"""Skipped tests under an eye: with `--strict-skips` a skip for a reason that is not known fails the run.

A pytest plugin. CI adds `--may-skip` for what the machine has been found not to have.
"""

from __future__ import annotations

import re
from collections import Counter

import pytest

# Reasons that hold on machines which are otherwise well
_KNOWN = (
    "the real photo sets are not at ",
    "a small disk cannot be mounted here: ",  # root alone may mount
    "nothing can be mounted here: ",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the two options."""
    group = parser.getgroup("skips")
    group.addoption("--strict-skips", action="store_true", help="Fail if a test is skipped for no known reason.")
    group.addoption(
        "--may-skip", action="append", default=[], metavar="REGEX", help="One more reason to skip; repeatable."
    )


def unknown(reasons: list[str], known: list[str]) -> Counter[str]:
    """Return how often each reason stands that none of the patterns begins."""
    return Counter(reason for reason in reasons if not any(re.match(pattern, reason) for pattern in known))


def _reasons(config: pytest.Config) -> list[str]:
    """Return the reason of every skip so far, of files too."""
    skipped = config.pluginmanager.getplugin("terminalreporter").stats.get("skipped", [])
    return [report.longrepr[2].removeprefix("Skipped: ") for report in skipped]


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail the run where a skip is not known."""
    config = session.config
    if config.option.strict_skips and not hasattr(config, "workerinput") and _unknown_of(config):
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Tell how many tests were skipped and why."""
    if not config.option.strict_skips:
        return
    told = Counter(_reasons(config))
    terminalreporter.section(f"{told.total()} skipped")
    unexpected = _unknown_of(config)
    for reason, count in told.items():
        terminalreporter.line(f"{count} {'UNEXPECTED ' if reason in unexpected else ''}{reason}")


def _unknown_of(config: pytest.Config) -> Counter[str]:
    return unknown(_reasons(config), [*map(re.escape, _KNOWN), *config.option.may_skip])
