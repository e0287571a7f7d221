"""Figures of a comparison, with their names and values; `drawing.py` draws them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from risk_sac.config import FamilyName, MethodName, method_of
from risk_sac.errors import ConfigError
from risk_sac.metrics import METRICS, WINDOW, Metric
from risk_sac.records import EpisodeRecord, Outcome, Phase
from risk_sac.report.comparison import Comparison
from risk_sac.report.runs import FinishedRun, Found, cpu_s
from risk_sac.world.types import Floats

Format = Literal["png", "svg"]
FORMATS: tuple[Format, ...] = get_args(Format)
SETTLED = 10  # episodes before which a windowed rate is mostly noise
TIMED_S, TIMES = 30.0, 121  # processor time that is drawn, and at how many points of it


@dataclass(frozen=True, slots=True)
class Curve:
    """A figure over the search's episodes, or over its processor time."""

    name: str
    label: str
    values: Callable[[FinishedRun], Floats]  # one per search episode
    methods: Callable[[MethodName], bool] = lambda method: True  # which have one
    log: bool = False
    top: float | None = None
    first: int = 1  # episode at which it begins
    timed: bool = False  # over processor time

    def over(self, runs: Sequence[FinishedRun]) -> tuple[Floats, Floats]:
        """Computes places to draw at, `n`, and values, `runs x n`.

        They go as far as the shortest run.
        """
        if not self.timed:
            each = [self.values(run) for run in runs]
            shortest = min(map(len, each))  # in processor time, runs play as many episodes as they can
            return np.arange(1.0, shortest + 1), np.array([values[:shortest] for values in each])
        at = np.linspace(0.0, TIMED_S, TIMES)
        at = at[at <= min(max(cpu_s(run), default=0.0) for run in runs)]
        over = [np.searchsorted(cpu_s(run), at, side="right") for run in runs]  # episodes that are over by then
        held = [np.append(0.0, self.values(run))[count] for run, count in zip(runs, over, strict=True)]
        return at, np.array(held)


def window_ecr(run: FinishedRun) -> Floats:
    """Returns ECR after each episode over the newest `WINDOW`, or fewer."""
    return _window_rate(run, lambda record: record.collision is not None and record.collision.valid)


def window_pcr(run: FinishedRun) -> Floats:
    """The same of PCR."""
    return _window_rate(run, lambda record: record.collision is not None and record.collision.preventable)


def _window_rate(run: FinishedRun, counted: Callable[[EpisodeRecord], bool]) -> Floats:
    """Returns the rate after each episode over the newest driven episodes."""
    driven = [record.outcome is not Outcome.INVALID for record in run.phase("search")]
    happened = [counted(record) for record in run.phase("search") if record.outcome is not Outcome.INVALID]
    total, after = np.concatenate(([0], np.cumsum(happened))), np.cumsum(driven)
    begin = np.maximum(0, after - WINDOW)
    rates: Floats = (total[after] - total[begin]) / np.maximum(after - begin, 1)
    return rates


def _over_search(value: Callable[[EpisodeRecord], float]) -> Callable[[FinishedRun], Floats]:
    return lambda run: np.array([value(record) for record in run.phase("search")])


def _found(count: Callable[[Found], int]) -> Callable[[FinishedRun], Floats]:
    return lambda run: np.array([float(count(found)) for found in run.found])


CURVES = (
    Curve("ecr", f"ECR, newest {WINDOW} episodes", window_ecr, top=1.0, first=SETTLED),
    Curve("pcr", f"PCR, newest {WINDOW} episodes", window_pcr, top=1.0, first=SETTLED),
    Curve("preventable_found", "distinct preventable failures", _found(lambda found: found.preventable), timed=True),
    Curve("distinct_found", "distinct failures", _found(lambda found: found.distinct), timed=True),
    Curve(
        "lambda",
        "dual variable λ",
        _over_search(lambda record: record.dual_variable),
        methods=lambda method: method_of(method).lagrangian,
    ),
    Curve(
        "alpha",
        "temperature α",
        _over_search(lambda record: record.temperature),
        methods=lambda method: method_of(method).stochastic,
        log=True,
    ),
)


@dataclass(frozen=True, slots=True)
class FamilyCurves:
    """A curve of each method of a family."""

    family: FamilyName
    curve: Curve


@dataclass(frozen=True, slots=True)
class Times:
    """Times from the release to a family's conflicts and contacts."""

    family: FamilyName
    phase: Phase


@dataclass(frozen=True, slots=True)
class Bars:
    """A metric of each method and family."""

    metric: Metric
    phase: Phase


def figure_names(comparison: Comparison) -> tuple[str, ...]:
    """Lists the figures that can be drawn."""
    return tuple(_figures(comparison))


def figure_bytes(comparison: Comparison, name: str, format_: Format) -> bytes:
    """See `figure_files`."""
    return figure_files(comparison, name, [format_])[0]


def figure_files(comparison: Comparison, name: str, formats: Sequence[Format] = FORMATS) -> list[bytes]:
    """Returns a figure's files by format; equal comparisons give equal bytes."""
    figures = _figures(comparison)
    if name not in figures:
        raise ConfigError("", f"{name!r}", f"one of {', '.join(figures) or 'none: no run has finished'}")
    from risk_sac.report.drawing import draw  # Imported here: loading matplotlib takes a second.

    return draw(comparison, figures[name], formats)


def curve_values(
    comparison: Comparison, family: FamilyName, curve: Curve
) -> Iterator[tuple[MethodName, Floats, Floats]]:
    """Yields methods, drawn places, `n`, and values there, `runs x n`."""
    for method in comparison.methods:
        runs = comparison.of_cell(family, method)
        if runs and curve.methods(method) and (not curve.timed or all(map(cpu_s, runs))):
            yield method, *curve.over(runs)


def _figures(comparison: Comparison) -> dict[str, FamilyCurves | Times | Bars]:
    figures: dict[str, FamilyCurves | Times | Bars] = {}
    for family in (family for family in comparison.spec.families if comparison.group(family, "search")):
        for curve in CURVES:
            if any(curve_values(comparison, family, curve)):
                figures[f"{curve.name}_{family}"] = FamilyCurves(family, curve)
    for phase in comparison.phases:
        suffix = "" if phase == "search" else f"_{phase}"
        for family in comparison.spec.families:
            if any(sum(cell.contacts_by_second) for cell in comparison.group(family, phase)):
                figures[f"times_{family}{suffix}"] = Times(family, phase)
        for metric in (metric for metric in METRICS if not metric.search_only):
            figures[f"bars_{metric.name}{suffix}"] = Bars(metric, phase)
    return figures
