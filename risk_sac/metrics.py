"""What a run achieved: ECR, PCR, ES, ρ̄_c and OFD with their 95 % intervals, and the digest of its records.

Source: RISK-SAC, Sec. IV (evaluation metrics); what the paper leaves open is marked as a choice.
"""

import hashlib
import json
import math
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from risk_sac.errors import NotFinite
from risk_sac.types import STEP_S, Collision, EpisodeRecord, Floats, Outcome, Record, RunMetrics
from risk_sac.verdicts.distinct import DistinctFailures
from risk_sac.verdicts.distinct import distinct_failures as distinct_failures

STEPS_PER_S = round(1 / STEP_S)
WINDOW = 100  # episodes of the sliding ECR and PCR
NORMAL_QUANTILE = 1.959963984540054  # two-sided 95 %
RESAMPLES = 10_000


class Feature(NamedTuple):
    """One outcome feature and the physical range that is scaled to [0, 1]; values beyond it are clipped."""

    name: str
    low: float
    high: float


# Choice: the paper names the features but no scale. Fixed physical ranges keep OFD comparable between runs.
FEATURES = (
    Feature("min_ttc_s", 0.0, 3.0),  # beyond 3 s nobody speaks of a conflict
    Feature("relative_speed_mps", 0.0, 20.0),  # urban: 72 km/h
    Feature("lateral_offset_m", -3.5, 3.5),  # half a car's length plus half a car's width to either side
    Feature("min_robustness", -3.0, 1.0),  # in scales: the monitor clips at -3, and 1 is a clear margin
)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a rate.

    Args:
        successes: k, 0 <= k <= n.
        trials: n; with 0 nothing is known and the interval is [0, 1].

    Returns:
        (low, high) within [0, 1]; contains k/n.

    Source: Wilson 1927, Probable inference, the law of succession, and statistical inference.
    """
    if trials == 0:
        return 0.0, 1.0
    z2 = NORMAL_QUANTILE**2
    rate = successes / trials
    centre = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    half = NORMAL_QUANTILE * math.sqrt(rate * (1 - rate) / trials + z2 / (4 * trials**2)) / (1 + z2 / trials)
    # At rates of 0 and 1 the bound equals the rate; rounding must not push it past.
    return max(0.0, min(centre - half, rate)), min(1.0, max(centre + half, rate))


def bootstrap_interval(values: Sequence[float], seed: int) -> tuple[float, float]:
    """Percentile bootstrap 95 % interval of the mean over seeds.

    With fewer than about ten seeds it is narrower than its name; one seed gives a point.

    Args:
        values: one figure per seed, at least one.
        seed: of the resampling; the same seed gives the same interval.

    Returns:
        (low, high) within [min, max] of the values.

    Raises:
        ValueError: there are no values.
        NotFinite: a value is NaN or infinite.
    """
    if not values:
        raise ValueError("values is empty; wanted one figure per seed")
    sample = np.asarray(values, dtype=np.float64)
    if not np.isfinite(sample).all():
        raise NotFinite(f"values is {list(values)}; wanted finite figures, one per seed")
    drawn = np.random.default_rng(seed).integers(len(sample), size=(RESAMPLES, len(sample)))
    low, high = np.quantile(sample[drawn].mean(axis=1), (0.025, 0.975)).clip(sample.min(), sample.max())
    return float(low), float(high)


def effective_collision_rate(records: Sequence[EpisodeRecord]) -> float:
    """ECR: valid collisions per episode, rejected scenes included; 0 without episodes. Source: Sec. IV."""
    return sum(record.outcome is Outcome.FAILURE for record in records) / max(1, len(records))


def preventable(record: EpisodeRecord) -> bool:
    """Whether the episode ended in a valid collision that the careful driver would have prevented."""
    return record.outcome is Outcome.FAILURE and record.collision is not None and record.collision.preventable


def preventable_collision_rate(records: Sequence[EpisodeRecord]) -> float:
    """PCR: valid collisions of grade `careful` per episode, rejected scenes included; 0 without episodes.

    A collision that was never judged counts as not preventable.
    """
    return sum(preventable(record) for record in records) / max(1, len(records))


def efficiency_score(records: Sequence[EpisodeRecord], horizon_steps: int) -> float:
    """How much of the horizon an episode saves by failing early, ES.

    ES = 1 - (mean steps to the first valid collision) / T

    Choice: an episode without a valid collision counts T, and so does a rejected scene although it took 0 steps;
    counting what it took would reward a search for proposing impossible scenes.

    Args:
        records: any number.
        horizon_steps: T.

    Returns:
        In [0, 1]; 0 without episodes or without failures.

    Source: RISK-SAC, Sec. IV.
    """
    steps = sum(_steps_to_failure(record, horizon_steps) for record in records)
    return 1 - steps / (len(records) * horizon_steps) if records else 0.0


def cost_rate(records: Sequence[EpisodeRecord]) -> float:
    """Mean realism cost C_soft per executed step, ρ̄_c; 0 without steps.

    Rejected scenes executed none; `RunMetrics.rejected` counts them. Source: RISK-SAC, Sec. IV.
    """
    cost = math.fsum(record.mean_cost * record.steps for record in records if record.steps)
    return cost / max(1, sum(record.steps for record in records))


def outcome_features(collision: Collision) -> Floats:
    """Outcome features of one failure, each scaled to [0, 1] and clipped.

    Returns:
        `FEATURES`.

    Raises:
        NotFinite: a feature is NaN; infinite ones are clipped.
    """
    values = np.array([getattr(collision, feature.name) for feature in FEATURES], dtype=np.float64)
    if np.isnan(values).any():
        raise NotFinite(f"collision at {collision.time_s:g} s has outcome features {values.tolist()}; wanted no NaN")
    low, high = (np.array([getattr(feature, end) for feature in FEATURES]) for end in ("low", "high"))
    scaled: Floats = ((values - low) / (high - low)).clip(0.0, 1.0)
    return scaled


def outcome_dispersion(features: Floats) -> float | None:
    """Mean distance between two failures, OFD.

    OFD = 2 / (n (n - 1)) Σ_{i<j} ||x_i - x_j|| / √(number of features)

    Args:
        features: `n x FEATURES`, in [0, 1].

    Returns:
        In [0, 1]; None with fewer than two failures.

    Source: RISK-SAC, Sec. IV; √features brings the largest distance to 1.
    """
    count, width = features.shape
    if count < 2:
        return None
    # One row against those before it: n passes with O(n) memory, where all pairs at once would need O(n²).
    total = math.fsum(_distances(features[:row], features[row]) for row in range(1, count))
    pairs: float = count * (count - 1) / 2
    return total / pairs / math.sqrt(width)


def results_digest(records: Sequence[EpisodeRecord]) -> str:
    """SHA-256 over one line of canonical JSON per record; equal digests mean equal results.

    Keys are sorted and floats written so that they read back exactly. Records hold no wall-clock values.
    """
    digest = hashlib.sha256()
    for record in records:
        line = json.dumps(record, default=_plain, sort_keys=True, separators=(",", ":"))
        digest.update(line.encode() + b"\n")
    return digest.hexdigest()


class Funnel(Record):
    """From what the ego touched to what is worth a person's time; each count is part of the one before."""

    contacts: int
    valid: int
    distinct: int
    preventable: int
    """Distinct failures that the careful driver would have prevented."""

    @classmethod
    def of(cls, metrics: RunMetrics) -> "Funnel":
        """The funnel of a run."""
        return cls(
            contacts=metrics.raw_collisions,
            valid=metrics.failures,
            distinct=metrics.distinct_failures,
            preventable=metrics.distinct_preventable,
        )


# The counts of a run; several runs have their sums.
COUNTS = (
    "episodes",
    "rejected",
    "raw_collisions",
    "failures",
    "distinct_failures",
    "preventable",
    "distinct_preventable",
    "artefacts",
    "unresponsive",
    "environment_steps",
)


def pooled_counts(metrics: Sequence[RunMetrics]) -> dict[str, int]:
    """`COUNTS`, each summed over the runs; what two runs found alike counts twice."""
    return {name: sum(getattr(each, name) for each in metrics) for name in COUNTS}


def pooled_signatures(metrics: Sequence[RunMetrics]) -> dict[str, int]:
    """Valid failures per signature over the runs, in the order in which the runs first met them."""
    pooled: Counter[str] = Counter()
    for each in metrics:
        pooled.update(each.signatures)
    return dict(pooled)


def pooled_bins(histograms: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """Histograms summed bin by bin; one from before there were any is empty."""
    return tuple(map(sum, zip_longest(*histograms, fillvalue=0)))


class MetricsAccumulator:
    """`RunMetrics` kept up to date, at a cost per episode that grows only with the number of failures.

    Adding a run's stored records again, in order, restores it exactly.
    """

    def __init__(self, horizon_steps: int) -> None:
        if horizon_steps < 1:
            raise ValueError(f"horizon_steps is {horizon_steps}; wanted at least 1")
        self._horizon_steps = horizon_steps
        self._episodes = self._rejected = self._raw_collisions = self._failures = 0
        self._steps = self._steps_to_failure = 0
        self._cost = self._distance = 0.0
        self._preventable = self._distinct_preventable = self._artefacts = self._unresponsive = 0
        self._window: deque[tuple[bool, bool]] = deque(maxlen=WINDOW)  # failed, preventably
        self._signatures: Counter[str] = Counter()
        seconds = math.ceil(horizon_steps / STEPS_PER_S)
        self._conflicts, self._contacts = [0] * seconds, [0] * seconds
        self._features = np.empty((64, len(FEATURES)))  # doubled when full; the first `_failures` rows count
        self._distinct = DistinctFailures()
        self._dual_variable = self._temperature = 0.0

    def add(self, record: EpisodeRecord) -> RunMetrics:
        """Count one more episode.

        Raises:
            NotFinite: its mean cost, or when its conflict or contact was, is not finite, or an outcome feature is NaN.
            ValueError: it is a failure without a collision.
        """
        if record.steps and not math.isfinite(record.mean_cost):
            raise NotFinite(f"mean_cost of episode {record.index} is {record.mean_cost}; wanted a finite number")
        failed = record.outcome is Outcome.FAILURE
        if failed:
            self._add_failure(record)
        self._episodes += 1
        self._rejected += record.outcome is Outcome.REJECTED
        self._raw_collisions += failed or record.outcome is Outcome.DEGENERATE
        self._steps += record.steps
        self._steps_to_failure += _steps_to_failure(record, self._horizon_steps)
        self._cost += record.mean_cost * record.steps if record.steps else 0.0
        self._artefacts += record.collision is not None and record.collision.artefact
        self._window.append((failed, preventable(record)))
        self._dual_variable, self._temperature = record.dual_variable, record.temperature
        return self.metrics()

    def _add_failure(self, record: EpisodeRecord) -> None:
        if record.collision is None:
            raise ValueError(f"episode {record.index} is a failure without a collision; wanted its collision record")
        features = outcome_features(record.collision)
        _require_finite_times(record.collision)  # before anything is counted
        if self._failures == len(self._features):
            self._features = np.concatenate((self._features, np.empty_like(self._features)))
        self._distance += _distances(self._features[: self._failures], features)
        self._features[self._failures] = features
        self._failures += 1
        new = self._distinct.add(record.collision)
        self._preventable += record.collision.preventable
        self._distinct_preventable += new and record.collision.preventable
        if record.collision.judgement is not None:
            self._unresponsive += record.collision.judgement.unresponsive
            self._signatures[record.collision.judgement.signature] += 1
            self._conflicts[self._second(record.collision.judgement.conflict_s)] += 1
            self._contacts[self._second(record.collision.time_s)] += 1

    def _second(self, time_s: float) -> int:
        """The bin of a time; what began before the release is in the first, and the horizon's end in the last."""
        return min(max(0, math.floor(time_s)), len(self._contacts) - 1)

    def metrics(self) -> RunMetrics:
        """The figures over all episodes added so far."""
        low, high = wilson_interval(self._failures, self._episodes)
        pcr_low, pcr_high = wilson_interval(self._preventable, self._episodes)
        newest = max(1, len(self._window))
        pairs = self._failures * (self._failures - 1) / 2
        saved = 1 - self._steps_to_failure / (self._episodes * self._horizon_steps) if self._episodes else 0.0
        return RunMetrics(
            episodes=self._episodes,
            rejected=self._rejected,
            raw_collisions=self._raw_collisions,
            failures=self._failures,
            environment_steps=self._steps,
            ecr=self._failures / max(1, self._episodes),
            ecr_low=low,
            ecr_high=high,
            window_ecr=sum(failed for failed, _ in self._window) / newest,
            efficiency=saved,
            cost_rate=self._cost / max(1, self._steps),
            dispersion=self._distance / pairs / math.sqrt(len(FEATURES)) if pairs else None,
            dual_variable=self._dual_variable,
            temperature=self._temperature,
            distinct_failures=self._distinct.count,
            steps_per_distinct_failure=self._steps / self._distinct.count if self._distinct.count else None,
            preventable=self._preventable,
            pcr=self._preventable / max(1, self._episodes),
            pcr_low=pcr_low,
            pcr_high=pcr_high,
            window_pcr=sum(prevented for _, prevented in self._window) / newest,
            distinct_preventable=self._distinct_preventable,
            artefacts=self._artefacts,
            unresponsive=self._unresponsive,
            signatures=dict(self._signatures),
            conflicts_by_second=tuple(self._conflicts),
            contacts_by_second=tuple(self._contacts),
        )


def _preventable(record: EpisodeRecord) -> bool:
    return record.outcome is Outcome.FAILURE and record.collision is not None and record.collision.preventable


def _require_finite_times(collision: Collision) -> None:
    times_s = [collision.time_s]
    if collision.judgement is not None:
        times_s.append(collision.judgement.conflict_s)
    if not all(map(math.isfinite, times_s)):
        raise NotFinite(
            f"collision with {collision.other_id!r} and its conflict are at {times_s} s; wanted finite times"
        )


def _steps_to_failure(record: EpisodeRecord, horizon_steps: int) -> int:
    return record.steps if record.outcome is Outcome.FAILURE else horizon_steps


def _distances(rows: Floats, point: Floats) -> float:
    """Sum of the Euclidean distances from `point` to each of `rows`."""
    return float(np.sqrt(((rows - point) ** 2).sum(axis=1)).sum())


def _plain(value: object) -> dict[str, Any]:
    """Records and mappings as dicts, shallowly; `json` comes back for what they contain."""
    if isinstance(value, Record):
        # Records from before contacts were judged keep the digest they had.
        return {name: each for name, each in value if (name, each) != ("judgement", None)}
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{value!r} of {type(value).__name__} has no canonical JSON; wanted a record of plain values")
