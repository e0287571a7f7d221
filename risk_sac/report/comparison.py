"""The comparison of methods over seeds: cells, pairwise tests, and what they rest on. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from risk_sac.config import CampaignSpec, FamilyName, MethodName, RunSpec
from risk_sac.metrics import RESAMPLING_SEED, Metric, MetricName, bootstrap_interval
from risk_sac.records import RECORDED, Phase
from risk_sac.report.cells import Cell, cell_of, metrics_of
from risk_sac.report.runs import FinishedRun
from risk_sac.report.statistics import holm, vargha_delaney, wilcoxon_p

REFERENCE: MethodName = "risk-sac"
LEVEL = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTest:
    """The reference against another method in one metric, runs paired by seed."""

    family: FamilyName
    phase: Phase
    metric: MetricName
    reference: MethodName
    method: MethodName
    pairs: int
    """Seeds for which both have a value."""
    difference: float | None
    """Mean of reference - method; null without a pair."""
    low: float | None
    """95 % interval of the difference, bootstrapped over the pairs; null with fewer than two."""
    high: float | None
    p: float | None
    """Wilcoxon signed-rank, exact, two-sided; null with fewer than two pairs."""
    p_holm: float | None
    """Corrected over all tests of the same family and phase."""
    a12: float | None
    """Vargha-Delaney: chance that the reference's value is the larger one."""

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - a body of the service shows it

    @property
    def significant(self) -> bool:
        """Whether the corrected p is below 5 %."""
        return self.p_holm is not None and self.p_holm < LEVEL


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingRun:
    """A run of the campaign that the tables lack."""

    spec: RunSpec
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What the report shows. The same runs give the same comparison."""

    spec: CampaignSpec
    command: str
    spec_file: str  # where `risk-sac run --spec` finds the campaign
    spec_command: str  # what a reader types to have that file; empty where it lies there already
    methods: tuple[MethodName, ...]  # the reference first
    runs: tuple[FinishedRun, ...]  # by family, method and seed
    missing: tuple[MissingRun, ...]
    cells: tuple[Cell, ...]  # by family, phase and method
    tests: tuple[PairedTest, ...]

    @property
    def reference(self) -> MethodName:
        """The method that all others are compared with."""
        return self.methods[0]

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The phases that runs have."""
        return tuple(phase for phase in RECORDED if any(cell.phase == phase for cell in self.cells))

    def group(self, family: FamilyName, phase: Phase) -> tuple[Cell, ...]:
        """The cells of one table, the reference first."""
        return tuple(cell for cell in self.cells if (cell.family, cell.phase) == (family, phase))

    def of_cell(self, family: FamilyName, method: MethodName) -> tuple[FinishedRun, ...]:
        """The runs of a method in a family."""
        return tuple(run for run in self.runs if run.cell == (family, method))

    @property
    def versions(self) -> Mapping[str, str]:
        """Package -> its version; all of them where runs differ."""
        names = sorted({name for run in self.runs for name in run.versions})
        return {
            name: ", ".join(sorted({run.versions[name] for run in self.runs if name in run.versions})) for name in names
        }


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

    Args:
        spec: the campaign.
        runs: finished runs, in any order; those of other specs are left out.
        command: what a reader types to get the same.
        spec_file: where `risk-sac run --spec` finds the campaign.
        spec_command: what a reader types to have that file; empty where it lies there already.
        reasons: why a run is missing, by `RunSpec.digest`; "not finished" for the rest.
    """
    methods = _reference_first(spec.methods)
    found = {run.spec.digest: run for run in runs}
    wanted = sorted(spec.runs(), key=lambda run: (spec.families.index(run.family), methods.index(run.method), run.seed))
    kept = tuple(found[run.digest] for run in wanted if run.digest in found)
    missing = tuple(
        MissingRun(spec=run, reason=(reasons or {}).get(run.digest, "not finished"))
        for run in wanted
        if run.digest not in found
    )
    return Comparison(
        spec=spec,
        command=command,
        spec_file=spec_file,
        spec_command=spec_command,
        methods=methods,
        runs=kept,
        missing=missing,
        cells=tuple(_cells(kept)),
        tests=tuple(_tests(spec, methods, kept)),
    )


def _reference_first(methods: Sequence[MethodName]) -> tuple[MethodName, ...]:
    reference = REFERENCE if REFERENCE in methods else methods[0]
    return (reference, *(method for method in methods if method != reference))


def _cells(runs: Sequence[FinishedRun]) -> Iterator[Cell]:
    for _, of_family in groupby(runs, key=lambda run: run.spec.family):
        cells = [list(group) for _, group in groupby(of_family, key=lambda run: run.cell)]
        for phase in RECORDED:
            yield from (cell_of(group, phase) for group in cells if phase in group[0].metrics)


def _tests(spec: CampaignSpec, methods: Sequence[MethodName], runs: Sequence[FinishedRun]) -> Iterator[PairedTest]:
    """Every other method against the first, corrected per family and phase."""
    phases: tuple[Phase, ...] = ("search", "evaluation") if spec.budget.evaluation_episodes else ("search",)
    for family in spec.families:
        by_method = {method: {run.spec.seed: run for run in runs if run.cell == (family, method)} for method in methods}
        for phase in phases:
            yield from _corrected(
                [
                    _paired_test(metric, phase, by_method[methods[0]], by_method[other], (family, methods[0], other))
                    for metric in metrics_of(phase)
                    if metric.tested
                    for other in methods[1:]
                ]
            )


def _paired_test(
    metric: Metric,
    phase: Phase,
    ours: Mapping[int, FinishedRun],
    theirs: Mapping[int, FinishedRun],
    names: tuple[FamilyName, MethodName, MethodName],
) -> PairedTest:
    family, reference, method = names
    pairs = []
    for seed in sorted(ours.keys() & theirs.keys()):
        one, other = (metric.value(runs[seed].metrics[phase]) for runs in (ours, theirs))
        if one is not None and other is not None:
            pairs.append((one, other))
    differences = [one - other for one, other in pairs]
    low, high = bootstrap_interval(differences, RESAMPLING_SEED) if len(pairs) > 1 else (None, None)
    return PairedTest(
        family=family,
        phase=phase,
        metric=metric.name,
        reference=reference,
        method=method,
        pairs=len(pairs),
        difference=sum(differences) / len(pairs) if pairs else None,
        low=low,
        high=high,
        p=wilcoxon_p(differences) if len(pairs) > 1 else None,
        p_holm=None,
        a12=vargha_delaney(*zip(*pairs, strict=True)) if pairs else None,
    )


def _corrected(tests: Sequence[PairedTest]) -> Iterator[PairedTest]:
    """Holm over the tests that have a p."""
    adjusted = iter(holm([test.p for test in tests if test.p is not None]))
    for test in tests:
        yield test if test.p is None else replace(test, p_holm=next(adjusted))
