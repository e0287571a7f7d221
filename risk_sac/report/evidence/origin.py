"""Where a report comes from: how its reader has each number again."""

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from risk_sac.failures.cases import Regression
from risk_sac.report.comparison import Comparison
from risk_sac.report.markdown import run_command
from risk_sac.report.runs import FinishedRun


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """What only the caller knows: where the runs lie, and what to type."""

    report: str  # the command that makes this report
    data: str  # the command that gives bounds and coverage as JSON
    show: Callable[[FinishedRun, str], str]  # of a run and the id of one of its failures: the command that draws it
    regress: str  # the command that plays the failures against another ego
    folders: Mapping[str, Path] = field(default_factory=dict)  # by digest of the run's spec
    regression: Regression | None = None  # the campaign's failures against another ego, where somebody has played them


def again(comparison: Comparison, run: FinishedRun) -> str:
    """The command that gives a run's digest again; the last section says where its spec is from."""
    return run_command(run.spec, comparison.spec_file, "repeated")


def show_command(folder: Path, failure: str) -> str:
    """Draws a failure of a run whose folder lies here."""
    return shlex.join(["risk-sac", "show", str(folder), failure, "--out", "failure.png"])
