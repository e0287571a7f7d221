"""Accumulates a run's records into its metrics and its digest.

The digest is what results are compared by.
"""

import hashlib
import json
from collections.abc import Sequence
from typing import Any

from risk_sac.metrics.rows import METRICS, steps_per_distinct_failure
from risk_sac.metrics.tally import Tally
from risk_sac.records import Counts, EpisodeRecord, RunMetrics

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
    """SHA-256 over one line of canonical JSON per record; equal digests mean equal results.

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
