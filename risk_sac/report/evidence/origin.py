"""Origin of a report: commands, folders, and the drawing of a failure."""

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from risk_sac.errors import DamagedError, RiskSacError
from risk_sac.failures.cases import Regression
from risk_sac.failures.net import roads_of
from risk_sac.failures.recording import Recording
from risk_sac.failures.signals import signal_heads
from risk_sac.failures.thumbnail import thumbnail
from risk_sac.report.comparison import Comparison
from risk_sac.report.evidence.document import Drawing
from risk_sac.report.markdown import run_command
from risk_sac.report.runs import FinishedRun
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RecordedFailure, series_name

DAMAGED = Drawing(None, "its time series or the road net is damaged")


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Places of the runs and commands to type, known to the caller only."""

    report: str  # the command that makes this report
    data: str  # the command that gives bounds and coverage as JSON
    show: Callable[[FinishedRun, str], str]  # of a run and the id of one of its failures: the command that draws it
    regress: str  # the command that plays the failures against another ego
    folders: Mapping[str, Path] = field(default_factory=dict)  # by digest of the run's spec
    regression: Regression | None = None  # the campaign's failures against another ego, if played


def again(comparison: Comparison, run: FinishedRun) -> str:
    """Returns the command that reproduces a run's digest; the last section says where its spec is from."""
    return run_command(run.spec, comparison.spec_file, "repeated")


def show_command(folder: Path, failure: str) -> str:
    """Returns the command that draws a failure of the run in a folder."""
    return shlex.join(["risk-sac", "show", str(folder), failure, "--out", "failure.png"])


def draw(run: FinishedRun, folder: Path | None, index: int) -> Drawing:
    """Draws the failure of an episode from above, or says what is missing; `folder` is that of its run."""
    if folder is None:
        return Drawing(None, "the folder of its run is missing")
    record = next(each for each in run.records if each.index == index)
    try:
        series = read_series(folder / FAILURES / series_name(index))
        recording = Recording(RecordedFailure.of(run.spec.id, record), series)
        place = run.spec.family, record.scene
        return Drawing(thumbnail(recording, roads_of(*place), signal_heads(*place)).encode())
    except DamagedError:
        return DAMAGED
    except RiskSacError as error:  # of a place on a map
        return Drawing(None, str(error))
    except FileNotFoundError as error:
        lost = "its time series" if str(error.filename or "").endswith(".npz") else "the road net"
        return Drawing(None, f"{lost} is gone")
    except OSError as error:
        return Drawing(None, f"it cannot be read: {error.strerror}")
    except (ValueError, LookupError, SyntaxError):  # the last: of the net's XML
        return DAMAGED
