"""Compares methods over seeds: cells, paired tests and their basis. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Annotated, Any

from pydantic import Field

from risk_sac.config import CampaignSpec, FamilyName, MethodName, RunMethod, RunSpec
from risk_sac.failures.studied import Studied
from risk_sac.metrics import (
    METRICS,
    RATIOS,
    Estimate,
    Metric,
    MetricName,
    estimate,
    headline_driven_by,
    pcr_by_driver,
    pooled_bins,
    pooled_counts,
    pooled_headline,
    pooled_names,
    pooled_published,
    pooled_requirements,
)
from risk_sac.records import PHASES, Counts, DriverPcr, EpisodeRecord, Phase, Record, RequirementCounts
from risk_sac.report.runs import (
    PAID_FOR,
    TESTED,
    FailureOrigin,
    FinishedRun,
    Overview,
    failure_origins,
    found_within,
    overview,
    versions_of,
)
from risk_sac.report.statistics import PairedTest, corrected, paired_tests

REFERENCE: MethodName = "risk-sac"
PAID_REFERENCE: MethodName = "risk-sac-diverse"
RIVALS: tuple[MethodName, ...] = ("sac", "ddpg")
DECLARED: tuple[MetricName, ...] = ("ecr", "pcr")
"""What the reference is to have more of than its rivals."""


def metrics_of(phase: Phase) -> tuple[Metric, ...]:
    """The metrics that a phase has."""
    return tuple(metric for metric in METRICS if phase == "search" or not metric.search_only)


class Cell(Counts):
    """Results of a method in a family and phase, over finished runs."""

    family: FamilyName
    method: RunMethod
    phase: Phase
    seeds: tuple[int, ...]
    """Of the runs that are counted."""
    headline: int | None
    """Each kind once."""
    headline_published: int | None
    """Of these kinds, those that R157, FSM or RSS prevents."""
    estimates: Mapping[MetricName, Estimate]
    """By the name of the metric."""
    steps_per_distinct_failure: float | None
    cpu_s_per_distinct_failure: float | None
    """Processor seconds of the whole runs; of the search only."""
    raw_rate: float
    """Contacts / episodes."""
    artefact_rate: float
    """Contacts that the simulator or the control made / episodes."""
    degenerate_rate: float
    """Contacts that are not valid / episodes."""
    rejected_rate: float
    """Infeasible scenes / episodes."""
    unresponsive_share: float | None
    """`unresponsive` / valid contacts."""
    pcr_by_driver: Mapping[str, DriverPcr]
    """Reference driver → its own PCR; `published` → that of R157, FSM or RSS."""
    episodes_driven_by: Mapping[str, int]
    """What drove the adversaries → episodes."""
    headline_driven_by: Mapping[str, int]
    """What drove the first episode of a kind → headline failures."""
    by_severity: Mapping[str, int]
    """Severity → valid contacts."""
    by_fault: Mapping[str, int]
    """Fault → failures."""
    requirements: Mapping[str, RequirementCounts]
    """Requirement → its funnel."""
    kinds: Mapping[str, int]
    """Kind → valid violations."""
    conflicts_by_second: tuple[int, ...]
    """Valid contacts by the second in which the conflict began."""
    contacts_by_second: tuple[int, ...]
    """The same by the second of the contact."""


def cell_of(runs: Sequence[FinishedRun], phase: Phase) -> Cell:
    """Sums up a cell's runs, one or more, all played in `phase`."""
    (family, method) = runs[0].cell
    metrics = [run.metrics[phase] for run in runs]
    counts = pooled_counts(metrics)
    ratios: dict[str, Any] = {ratio.name: ratio.formula(counts) for ratio in RATIOS}
    distinct, cpu_s = counts.distinct_failures, sum(run.cpu_s for run in runs)
    return Cell(
        family=family,
        method=method,
        phase=phase,
        seeds=tuple(run.spec.seed for run in runs),
        headline=pooled_headline(metrics),
        headline_published=pooled_published(metrics),
        **dict(counts),
        **ratios,
        estimates={metric.name: estimate(metric, metrics) for metric in metrics_of(phase)},
        cpu_s_per_distinct_failure=cpu_s / distinct if distinct and phase == "search" else None,
        pcr_by_driver=pcr_by_driver(metrics),
        episodes_driven_by=pooled_names([each.episodes_driven_by for each in metrics]),
        headline_driven_by=headline_driven_by(metrics),
        by_severity=pooled_names([each.by_severity for each in metrics]),
        by_fault=pooled_names([each.by_fault for each in metrics]),
        requirements=pooled_requirements(metrics),
        kinds=pooled_names([each.kinds for each in metrics]),
        conflicts_by_second=pooled_bins([each.conflicts_by_second for each in metrics]),
        contacts_by_second=pooled_bins([each.contacts_by_second for each in metrics]),
    )


class MissingRun(Record):
    """A run that the tables lack."""

    family: FamilyName
    method: RunMethod
    seed: int
    reason: Annotated[str, Field(examples=["queued", "failed: worker was killed by SIGKILL"])]
    """Its state, and why it failed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Content of the report. The same runs give the same comparison."""

    spec: CampaignSpec
    command: str  # what a reader types to get the same
    spec_file: str  # where `risk-sac run --spec` finds the campaign
    spec_command: str  # what a reader types to have that file; empty where it lies there already
    methods: tuple[MethodName, ...]  # the reference first
    runs: tuple[FinishedRun, ...]  # by family, method and seed
    missing: tuple[MissingRun, ...]
    cells: tuple[Cell, ...]  # by family, phase and method
    tests: tuple[PairedTest, ...]
    overviews: Mapping[FamilyName, Overview]  # of the failures of all methods that repeat; families with runs alone
    drawn: tuple[FinishedRun, ...]  # of the i.i.d. phase; in no cell, no test and no overview
    undrawn: tuple[MissingRun, ...]  # of the i.i.d. phase too
    paid_tests: tuple[
        PairedTest, ...
    ]  # what a user pays for, by family; declared before any run, so corrected by itself

    @property
    def headline(self) -> int | None:
        """Counts distinct headline failures of all searches; None before any replay."""
        return pooled_headline(metrics for run in self.runs for metrics in run.metrics.values())

    @property
    def headline_published(self) -> int | None:
        """Of the headline failures, those that R157, FSM or RSS prevents."""
        return pooled_published(metrics for run in self.runs for metrics in run.metrics.values())

    @property
    def headline_candidates(self) -> int:
        """Those that each search found by itself, verified or not."""
        return sum(metrics.headline_candidates for run in self.runs for metrics in run.metrics.values())

    @property
    def origins(self) -> tuple[FailureOrigin, ...]:
        """Origins of failures in scenarios that some method plays as written."""
        return failure_origins(self.runs)

    @property
    def reference(self) -> MethodName:
        """The method that all others are compared with."""
        return self.methods[0]

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The phases that runs have."""
        return tuple(phase for phase in PHASES if any(cell.phase == phase for cell in self.cells))

    def group(self, family: FamilyName, phase: Phase) -> tuple[Cell, ...]:
        """The cells of one table, the reference first."""
        return tuple(cell for cell in self.cells if (cell.family, cell.phase) == (family, phase))

    def studies(self, family: FamilyName) -> Mapping[str, Studied]:
        """Collects the studies of replayed failures, by id."""
        return {
            record.id_in(run.spec.id): run.studies[record.index]
            for run in self.runs
            if run.spec.family == family
            for record in run.records
            if record.index in run.studies
        }

    def verified(self, cell: Cell) -> tuple[int, int] | None:
        """Counts a cell's failures repeated to the bit, and those replayed."""
        same = []
        for run in self.of_cell(cell.family, cell.method):
            if run.verified is None:
                return None
            repeated = run.verified.episodes
            same += [repeated[record.index].verified for record in run.phase(cell.phase) if record.index in repeated]
        return sum(same), len(same)

    def of_cell(self, family: FamilyName, method: RunMethod) -> tuple[FinishedRun, ...]:
        """The runs of a method in a family."""
        return tuple(run for run in self.runs if run.cell == (family, method))

    @property
    def versions(self) -> Mapping[str, str]:
        """Package → its version; all of them where runs differ."""
        return versions_of(self.runs)


def compare(
    spec: CampaignSpec,
    runs: Sequence[FinishedRun],
    command: str,
    *,
    spec_file: str = "spec.yaml",
    spec_command: str = "",
    reasons: Mapping[str, str] | None = None,
) -> Comparison:
    """Compares the methods of a campaign by the runs that have finished.

    The runs are in any order, those of the i.i.d. phase among them; those of other specs are left out. `reasons` says
    why a run is missing, by `RunSpec.digest`.
    """
    reference = REFERENCE if REFERENCE in spec.methods else spec.methods[0]
    methods = (reference, *(method for method in spec.methods if method != reference))
    run_by_digest = {run.spec.digest: run for run in runs}

    def missing(wanted: Sequence[RunSpec]) -> tuple[MissingRun, ...]:
        return tuple(
            MissingRun(
                family=run.family,
                method=run.method,
                seed=run.seed,
                reason=(reasons or {}).get(run.digest, "not finished"),
            )
            for run in wanted
            if run.digest not in run_by_digest
        )

    searches = spec.searches()
    wanted = sorted(searches, key=lambda run: (spec.families.index(run.family), methods.index(run.method), run.seed))
    kept = tuple(run_by_digest[run.digest] for run in wanted if run.digest in run_by_digest)
    families = dict.fromkeys(run.spec.family for run in kept)
    return Comparison(
        spec=spec,
        command=command,
        spec_file=spec_file,
        spec_command=spec_command,
        methods=methods,
        runs=kept,
        missing=missing(wanted),
        cells=tuple(_cells(kept)),
        tests=tuple(_tests(spec, methods, kept)),
        overviews={family: overview(_failures(family, kept)) for family in families},
        drawn=tuple(run_by_digest[run.digest] for run in spec.drawn() if run.digest in run_by_digest),
        undrawn=missing(spec.drawn()),
        paid_tests=tuple(_paid_tests(spec, methods, kept)),
    )


def _failures(family: FamilyName, runs: Sequence[FinishedRun]) -> Iterator[tuple[str, EpisodeRecord]]:
    for run in runs:
        if run.spec.family == family:
            yield from ((record.id_in(run.spec.id), record) for record in run.records)


def _cells(runs: Sequence[FinishedRun]) -> Iterator[Cell]:
    for _, of_family in groupby(runs, key=lambda run: run.spec.family):
        cells = [list(group) for _, group in groupby(of_family, key=lambda run: run.cell)]
        for phase in PHASES:
            yield from (cell_of(group, phase) for group in cells if phase in group[0].metrics)


def _tests(spec: CampaignSpec, methods: Sequence[MethodName], runs: Sequence[FinishedRun]) -> Iterator[PairedTest]:
    """Tests methods against the first per family and phase, declared ones apart."""
    phases: tuple[Phase, ...] = ("search", "evaluation") if spec.budget.evaluation_episodes else ("search",)
    for family in spec.families:
        by_method = _by_method(family, methods, runs)
        for phase in phases:
            tests: list[PairedTest] = []
            for metric in (metric for metric in metrics_of(phase) if metric.tested):
                values = {
                    method: {run.spec.seed: metric.value(run.metrics[phase]) for run in of_method}
                    for method, of_method in by_method.items()
                }
                tests += paired_tests(family, phase, metric.name, methods[0], values)
            yield from corrected([test for test in tests if declared(test)])
            yield from corrected([test for test in tests if not declared(test)])


def declared(test: PairedTest) -> bool:
    """Whether a test was declared before any run, and is corrected apart."""
    return test.reference == REFERENCE and test.method in RIVALS and test.metric in DECLARED


def _paid_tests(spec: CampaignSpec, methods: Sequence[MethodName], runs: Sequence[FinishedRun]) -> Iterator[PairedTest]:
    """Tests our own search, or the first method, against others, by family."""
    first = PAID_REFERENCE if PAID_REFERENCE in methods else methods[0]
    for family in spec.families:
        values = {
            method: {run.spec.seed: _paid(run) for run in of_method}
            for method, of_method in _by_method(family, methods, runs).items()
        }
        yield from corrected(list(paired_tests(family, "search", PAID_FOR, first, values)))


def _paid(run: FinishedRun) -> float | None:
    found = found_within(run, TESTED)
    return None if found is None else float(found.headline)


def _by_method(
    family: FamilyName, methods: Sequence[MethodName], runs: Sequence[FinishedRun]
) -> Mapping[MethodName, Sequence[FinishedRun]]:
    return {method: [run for run in runs if run.cell == (family, method)] for method in methods}
