"""What a report says as data: bounds and coverage, those of the search and of the i.i.d. phase apart."""

from collections.abc import Mapping

from risk_sac.config import FamilyName
from risk_sac.records import EpisodeRecord, Record
from risk_sac.report.comparison import Comparison
from risk_sac.report.evidence.bounds import Drawn, drawn
from risk_sac.report.evidence.coverage import Coverage, coverage
from risk_sac.report.runs import FinishedRun
from risk_sac.scenario.families import family_named


class FamilyCoverage(Record):
    """What was looked at in one family, by whom."""

    search: Coverage
    """By all searches together, the evaluation of frozen policies among them."""
    iid: Coverage | None
    """By the i.i.d. phase; null without one."""


class Evidence(Record):
    """What a campaign can say of how often its ego fails, and of where it looked."""

    complete: bool
    """Whether all runs are in it."""
    bounds: tuple[Drawn, ...]
    """Of the i.i.d. phase alone; none without one, however much was searched."""
    coverage: Mapping[FamilyName, FamilyCoverage]
    """Of the families with a finished run."""


def gathered(comparison: Comparison) -> Evidence:
    """The evidence of the runs that have finished.

    Raises:
      ConfigError: a run of the i.i.d. phase holds other episodes.
    """
    spec, runs = comparison.spec, comparison.runs
    found: dict[FamilyName, FamilyCoverage] = {}
    for family in spec.families:
        searched = _records(runs, family)
        fresh = _records(comparison.drawn, family)
        if searched or fresh:
            found[family] = FamilyCoverage(
                search=coverage(family_named(family), spec.odd, searched),
                iid=coverage(family_named(family), spec.odd, fresh) if fresh else None,
            )
    return Evidence(
        complete=not comparison.missing and not comparison.undrawn,
        bounds=tuple(map(drawn, comparison.drawn)),
        coverage=found,
    )


def _records(runs: tuple[FinishedRun, ...], family: FamilyName) -> list[EpisodeRecord]:
    return [record for run in runs if run.spec.family == family for record in run.records]
