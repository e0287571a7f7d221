"""Two methods against each other, runs paired by seed. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from risk_sac.config import FamilyName, MethodName
from risk_sac.metrics import RESAMPLING_SEED, MetricName, bootstrap_interval
from risk_sac.records import Phase
from risk_sac.report.statistics import holm, vargha_delaney, wilcoxon_p

LEVEL = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTest:
    """The reference against another method in one metric, runs paired by seed."""

    family: FamilyName
    phase: Phase
    metric: MetricName
    """Or what a user pays for, `preventable within 30 CPU s`."""
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
    """Corrected over the tests of the same family and phase that were declared beforehand, or over all others."""
    a12: float | None
    """Vargha-Delaney: chance that the reference's value is the larger one."""

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - a body of the service shows it

    @property
    def significant(self) -> bool:
        """Whether the corrected p is below 5 %."""
        return self.p_holm is not None and self.p_holm < LEVEL


Values = Mapping[int, float | None]
"""Seed → the value of its run; None where it has none."""


def paired_tests(
    family: FamilyName, phase: Phase, metric: MetricName, reference: MethodName, values: Mapping[MethodName, Values]
) -> list[PairedTest]:
    """The reference against every other method in one metric; not corrected."""
    return [
        _paired_test(family, phase, metric, (reference, values[reference]), (method, values[method]))
        for method in values
        if method != reference
    ]


def _paired_test(
    family: FamilyName,
    phase: Phase,
    metric: MetricName,
    ours: tuple[MethodName, Values],
    theirs: tuple[MethodName, Values],
) -> PairedTest:
    pairs = []
    for seed in sorted(ours[1].keys() & theirs[1].keys()):
        one, other = ours[1][seed], theirs[1][seed]
        if one is not None and other is not None:
            pairs.append((one, other))
    differences = [one - other for one, other in pairs]
    low, high = bootstrap_interval(differences, RESAMPLING_SEED) if len(pairs) > 1 else (None, None)
    return PairedTest(
        family=family,
        phase=phase,
        metric=metric,
        reference=ours[0],
        method=theirs[0],
        pairs=len(pairs),
        difference=sum(differences) / len(pairs) if pairs else None,
        low=low,
        high=high,
        p=wilcoxon_p(differences) if len(pairs) > 1 else None,
        p_holm=None,
        a12=vargha_delaney(*zip(*pairs, strict=True)) if pairs else None,
    )


def corrected(tests: Sequence[PairedTest]) -> Iterator[PairedTest]:
    """Holm over the tests that have a p."""
    adjusted = iter(holm([test.p for test in tests if test.p is not None]))
    for test in tests:
        yield test if test.p is None else replace(test, p_holm=next(adjusted))
