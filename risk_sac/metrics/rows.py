"""The metrics: their formulas and rows, and a run's figures and digest.

Source: RISK-SAC, Sec. IV; what the paper leaves open is marked as a choice.
"""

import hashlib
import json
import math
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field

from risk_sac.metrics.metric import FEATURES, Metric, Ratio
from risk_sac.metrics.tally import WINDOW, Tally
from risk_sac.records import ARTEFACT_RULES, Counts, EpisodeRecord, RunMetrics

PER_STEPS = 1000  # environment steps over which the rate of distinct failures is taken


def effective_collision_rate(counts: Counts) -> float:
    """ECR: valid contacts per rated episode, rejected scenes included. Source: Sec. IV."""
    return _share(counts.collisions, counts.rated)


def preventable_collision_rate(counts: Counts) -> float:
    """PCR: preventable contacts per episode."""
    return _share(counts.preventable_collisions, counts.rated)


def efficiency_score(tally: Tally) -> float:
    """Computes the share of the horizon saved by failing early, ES.

    ES = 1 - (mean steps to the first valid contact) / T

    Choice: an episode without a valid contact counts T, and so does a rejected scene.

    Returns:
        In [0, 1]; 0 without episodes or without failures.

    Source: RISK-SAC, Sec. IV.
    """
    return 1 - tally.steps_to_failure / (tally.rated * tally.horizon_steps) if tally.rated else 0.0


def cost_rate(tally: Tally) -> float:
    """Mean realism cost C_soft per executed step, ρ̄_c; 0 without steps.

    Rejected scenes executed none; `RunMetrics.rejected` counts them. Source: RISK-SAC, Sec. IV.
    """
    return tally.cost / max(1, tally.environment_steps)


def outcome_dispersion(tally: Tally) -> float | None:
    """Mean distance between two valid contacts, OFD.

    OFD = 2 / (n (n - 1)) Σ_{i<j} ||x_i - x_j|| / √(number of features)

    Returns:
        In [0, 1]; None with fewer than two.

    Source: RISK-SAC, Sec. IV; √features brings the largest distance to 1.
    """
    pairs: float = tally.collisions * (tally.collisions - 1) / 2
    return tally.distance / pairs / math.sqrt(len(FEATURES)) if pairs else None


def steps_per_distinct_failure(counts: Counts) -> float | None:
    """Environment steps per distinct failure; None without one."""
    return counts.environment_steps / counts.distinct_failures if counts.distinct_failures else None


def _per_steps(count: int, counts: Counts) -> float | None:
    return PER_STEPS * count / counts.environment_steps if counts.environment_steps else None


def _share(count: int, of: int) -> float:
    return count / max(1, of)


def _newest(counts: Counts) -> int:
    return min(WINDOW, counts.rated)


METRICS = (
    Metric(
        name="ecr",
        symbol="ECR",
        meaning="valid contacts / episodes",
        formula=effective_collision_rate,
        field="ecr",
        trials=lambda counts: counts.rated,
    ),
    Metric(
        name="pcr",
        symbol="PCR",
        meaning="preventable contacts / episodes: valid ones that a reference driver would have prevented",
        formula=preventable_collision_rate,
        field="pcr",
        trials=lambda counts: counts.rated,
    ),
    Metric(
        name="acr",
        symbol="ACR",
        meaning="avoidable contacts / episodes: valid ones that a reference driver, or full braking at once, would "
        "have prevented",
        formula=lambda counts: _share(counts.avoidable, counts.rated),
        trials=lambda counts: counts.rated,
        tested=False,
    ),
    Metric(
        name="ecr_last",
        symbol=f"ECR last {WINDOW}",
        meaning=f"ECR of the last {WINDOW} search episodes, or of all where there are fewer",
        formula=lambda tally: _share(tally.newest_failures, tally.newest_episodes),
        field="window_ecr",
        trials=_newest,
        search_only=True,
        tested=False,
    ),
    Metric(
        name="pcr_last",
        symbol=f"PCR last {WINDOW}",
        meaning=f"PCR of the last {WINDOW} search episodes, or of all where there are fewer",
        formula=lambda tally: _share(tally.newest_preventable, tally.newest_episodes),
        field="window_pcr",
        trials=_newest,
        search_only=True,
        tested=False,
    ),
    Metric(
        name="es",
        symbol="ES",
        words="efficiency",
        meaning="1 − (mean steps to the valid contact) / T; an episode without one counts the horizon T",
        formula=efficiency_score,
        field="efficiency",
    ),
    Metric(
        name="rho_c",
        symbol="ρ̄_c",
        words="realism cost per step",
        meaning="mean realism cost C_soft per executed step, in [0, 1]; lower is more realistic",
        formula=cost_rate,
        field="cost_rate",
    ),
    Metric(
        name="ofd",
        symbol="OFD",
        words="dispersion",
        meaning="mean distance between two valid contacts of a run in outcome features, in [0, 1]",
        formula=outcome_dispersion,
        field="dispersion",
    ),
    Metric(
        name="distinct_per_1000_steps",
        symbol=f"distinct / {PER_STEPS} steps",
        meaning=f"distinct valid violations per {PER_STEPS} environment steps",
        formula=lambda counts: _per_steps(counts.distinct_failures, counts),
        search_only=True,
        tabled=False,  # its reciprocal is
    ),
    Metric(
        name="preventable_per_1000_steps",
        symbol=f"preventable / {PER_STEPS} steps",
        meaning=f"distinct preventable violations per {PER_STEPS} environment steps",
        formula=lambda counts: _per_steps(counts.distinct_preventable, counts),
        search_only=True,
        tested=False,
    ),
    Metric(
        name="covered",
        symbol="kinds",
        meaning="cells of the fixed taxonomy of contacts that a valid one lies in",
        formula=lambda tally: len(tally.taxonomy),
        field="covered",
        search_only=True,
        tested=False,
    ),
)

MetricName = Annotated[
    str, Field(description="Such as `ecr`; the markdown table lists and defines them.", examples=[METRICS[0].name])
]

RATIOS = (
    Ratio(
        name="steps_per_distinct_failure",
        symbol="steps / distinct",
        meaning="environment steps over all seeds / distinct failures over all seeds",
        formula=steps_per_distinct_failure,
    ),
    Ratio(
        name="raw_rate",
        symbol="raw contacts",
        meaning="contacts of any kind / episodes",
        formula=lambda counts: _share(counts.raw_collisions, counts.rated),
    ),
    Ratio(
        name="artefact_rate",
        symbol="artefact",
        meaning="episodes whose contact was refused by a rule that speaks of the simulator or the control "
        f"({', '.join(sorted(ARTEFACT_RULES))}) / episodes",
        formula=lambda counts: _share(counts.artefacts, counts.rated),
    ),
    Ratio(
        name="degenerate_rate",
        symbol="degenerate",
        meaning="all refused contacts / episodes, artefacts among them",
        formula=lambda counts: _share(counts.raw_collisions - counts.collisions, counts.rated),
    ),
    Ratio(
        name="rejected_rate",
        symbol="rejected",
        meaning="infeasible scenes / episodes",
        formula=lambda counts: _share(counts.rejected, counts.rated),
    ),
    Ratio(
        name="unresponsive_share",
        symbol="unresponsive",
        meaning="valid contacts with a visible collision course of at least 1.5 s during which the ego never braked / "
        "valid contacts",
        formula=lambda counts: counts.unresponsive / counts.collisions if counts.collisions else None,
    ),
)

HISTOGRAMS = (
    "episodes_driven_by",
    "prevented_by",
    "by_severity",
    "by_fault",
    "kinds",
    "conflicts_by_second",
    "contacts_by_second",
)


class MetricsAccumulator:
    """`RunMetrics` kept up to date.

    Adding a run's stored records again, in order, restores it exactly.
    """

    def __init__(self, horizon_steps: int) -> None:
        self._tally = Tally(horizon_steps=horizon_steps)
        self._dual_variable = self._temperature = 0.0

    @property
    def episodes(self) -> int:
        """Added so far."""
        return self._tally.episodes

    def add(self, record: EpisodeRecord) -> RunMetrics:
        """Count one more episode; raises what `Tally.add` raises."""
        self._tally.add(record)
        self._dual_variable, self._temperature = record.dual_variable, record.temperature
        return self.metrics()

    def metrics(self) -> RunMetrics:
        """The figures over all episodes added so far."""
        tally = self._tally
        return RunMetrics(
            **{name: getattr(tally, name) for name in (*Counts.model_fields, *HISTOGRAMS)},
            **_figures(tally),
            requirements=tally.requirement_counts(),
            steps_per_distinct_failure=steps_per_distinct_failure(tally),
            dual_variable=self._dual_variable,
            temperature=self._temperature,
        )


def _figures(tally: Tally) -> dict[str, Any]:
    """Field of `RunMetrics` -> its value, for all metrics that have one."""
    figures: dict[str, float | None] = {}
    for metric in METRICS:
        if not metric.field:
            continue
        value = figures[metric.field] = metric.formula(tally)
        if value is not None and f"{metric.field}_low" in RunMetrics.model_fields:
            figures[f"{metric.field}_low"], figures[f"{metric.field}_high"] = metric.interval(value, tally) or (
                None,
                None,
            )
    return figures


class ResultsDigest:
    """SHA-256 of the records' canonical JSON; equal digests mean equal results.

    Keys are sorted, and floats written so that they read back exactly. Records hold no wall-clock values.
    """

    def __init__(self) -> None:
        self._digest = hashlib.sha256()

    def add(self, record: EpisodeRecord) -> None:
        """Adds the next record."""
        line = json.dumps(record.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
        self._digest.update(line.encode() + b"\n")

    def hexdigest(self) -> str:
        """Returns the digest so far."""
        return self._digest.hexdigest()


def results_digest(records: Sequence[EpisodeRecord]) -> str:
    """Returns the digest of some records; see `ResultsDigest`."""
    digest = ResultsDigest()
    for record in records:
        digest.add(record)
    return digest.hexdigest()
