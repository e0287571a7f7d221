"""Prometheus metrics, in a registry per app.

Stored quantities are counted at each scrape, so they survive restarts and cost nothing in between.
"""

import threading
from collections import Counter as Counts
from collections.abc import Callable, Iterator, Sequence

from prometheus_client import CollectorRegistry, Histogram, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from pydantic_core import from_json

from risk_sac.execution.executor import ClusterNode, ClusterState
from risk_sac.records import State
from risk_sac.risk.requirements import SHIPPED_REQUIREMENTS
from service.errors import StorageError
from service.runs.manager import Manager
from service.store.queries import Statistics, read_statistics
from service.store.reading import Store

BUCKETS_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)
SEARCH = ("family", "method")
REQUIREMENT = ("requirement",)
MOST_OWN = 50  # names of users' requirements that become labels
OTHERS = "(others)"  # no requirement can be called so
# The funnel, and what preventable failures are counted with repetitions; by the column that is summed up.
COUNTERS = {
    "episodes_done": ("risk_sac_episodes", "Finished episodes, rejected scenes included."),
    "raw_collisions": ("risk_sac_contacts", "Episodes in which the ego touched something."),
    "failures": ("risk_sac_failures", "Episodes with a valid violation of a requirement that counts."),
    "distinct_failures": ("risk_sac_distinct_failures", "Kinds of valid violations, of each run by itself."),
    "preventable": ("risk_sac_preventable_failures", "Failures that a reference driver would have prevented."),
    "distinct_preventable": (
        "risk_sac_distinct_preventable_failures",
        "Of these kinds, those that a reference driver would have prevented.",
    ),
    "distinct_published": (
        "risk_sac_distinct_published_failures",
        "Of these kinds, those that R157, FSM or RSS would have prevented.",
    ),
    "headline_candidates": (
        "risk_sac_headline_candidates",
        "Kinds of preventable violations that are plausible and no minor contacts.",
    ),
    "implausible": (
        "risk_sac_implausible_failures",
        "Kinds of preventable violations that are no minor contacts, but implausible.",
    ),
    "headline": (
        "risk_sac_headline_failures",
        "Candidates whose replay was the same; of each run by itself.",
    ),
}
# The funnel of each requirement; by the column that is summed up.
OF_REQUIREMENTS = {
    "violated": ("risk_sac_requirement_violated", "Episodes that violated the requirement."),
    "valid": ("risk_sac_requirement_valid", "Of these, failures: it counts, and the violation is valid."),
    "distinct": ("risk_sac_requirement_distinct", "Kinds of valid violations, of each run by itself."),
    "preventable": (
        "risk_sac_requirement_preventable",
        "Of these kinds, those that a reference driver would have prevented.",
    ),
    "published": (
        "risk_sac_requirement_published",
        "Of these kinds, those that R157, FSM or RSS would have prevented.",
    ),
}
NODE_GAUGES: tuple[tuple[str, str, Callable[[ClusterNode], float]], ...] = (
    ("alive", "Whether the cluster counts the node as alive.", lambda node: node.alive),
    ("slots", "Runs that the node has room for.", lambda node: node.slots),
    ("runs", "Runs at work on the node.", lambda node: len(node.silences)),
    ("silent_seconds", "Since a run on the node was heard of, at least.", lambda node: node.silent_s),
)
RATES = {"ecr": "Valid contacts", "pcr": "Preventable contacts"}


def request_latencies() -> Histogram:
    """Returns the histogram of answer times, by route, method and status."""
    return Histogram(
        "risk_sac_request_seconds",
        "Time until an answer began.",
        ("route", "method", "status"),
        buckets=BUCKETS_S,
        registry=None,
    )


def registry(latencies: Histogram, store: Store, manager: Manager) -> CollectorRegistry:
    """All there is to know about one running service."""
    metrics = CollectorRegistry()
    metrics.register(latencies)
    metrics.register(CampaignMetrics(store, manager))
    ProcessCollector(registry=metrics)
    return metrics


class CampaignMetrics(Collector):
    """Reads the database and the manager when it is scraped."""

    def __init__(self, store: Store, manager: Manager) -> None:
        self._store = store
        self._manager = manager
        self._counters = {name: _Monotone(SEARCH) for name in COUNTERS}
        self._of_requirements = {step: _Monotone(REQUIREMENT) for step in OF_REQUIREMENTS}
        self._labelled = set(SHIPPED_REQUIREMENTS)

    def collect(self) -> Iterator[Metric]:
        """All families; without those of the database while it cannot be read."""
        yield from _of_cluster(self._manager.cluster)
        refusal = self._manager.storage_problem
        restarts = CounterMetricFamily("risk_sac_worker_restarts", "Workers lost and replaced.", labels=["cause"])
        for cause, count in sorted(self._manager.restarts.items()):
            restarts.add_metric([cause], count)
        yield restarts
        try:
            yield from self._stored(read_statistics(self._store.engine))
        except StorageError as error:
            refusal = str(error)
        works = 0 if refusal else 1
        yield GaugeMetricFamily("risk_sac_storage_available", "Whether database and disk can be used.", value=works)

    def _stored(self, statistics: Statistics) -> Iterator[Metric]:
        yield from _states(statistics)
        for counted, (name, meaning) in COUNTERS.items():
            sums = Counts[tuple[str, ...]]()
            for tally in statistics.tallies:
                sums[tally.family, tally.method] += getattr(tally, counted) or 0  # null where none was replayed
            yield self._counters[counted].family(name, meaning, sums)
        yield from self._requirements(statistics)
        for name, rate in RATES.items():
            labels = ["campaign", "run", *SEARCH]
            gauge = GaugeMetricFamily(f"risk_sac_run_{name}", f"{rate} per episode of a run at work.", labels=labels)
            for run in statistics.at_work:
                metrics = {} if run.metrics is None else from_json(run.metrics)
                if (
                    metrics.get(name) is not None
                ):  # not before the first episode; the PCR not in what is older than judgements
                    gauge.add_metric([run.campaign_id, run.id, run.family, run.method], metrics[name])
            yield gauge

    def _requirements(self, statistics: Statistics) -> Iterator[Metric]:
        """Yields each requirement's funnel; the number of user-defined labels is bounded."""
        for row in statistics.requirements:
            if len(self._labelled) < len(SHIPPED_REQUIREMENTS) + MOST_OWN:
                self._labelled.add(row.name)
        for step, (name, meaning) in OF_REQUIREMENTS.items():
            sums = Counts[tuple[str, ...]]()
            for row in statistics.requirements:
                sums[(row.name if row.name in self._labelled else OTHERS,)] += getattr(row, step)
            yield self._of_requirements[step].family(name, meaning, sums)


def _of_cluster(cluster: ClusterState | None) -> Iterator[Metric]:
    """Yields metrics of each cluster node; none without a cluster."""
    if cluster is None:
        return
    yield GaugeMetricFamily("risk_sac_cluster_connected", "Whether there is a cluster.", value=int(bool(cluster.nodes)))
    for name, meaning, of in NODE_GAUGES:
        gauge = GaugeMetricFamily(f"risk_sac_node_{name}", meaning, labels=["node"])
        for node in cluster.nodes:
            gauge.add_metric([f"{node.address}/{node.id[:8]}"], of(node))
        yield gauge


class _Monotone:
    """Counters made of sums over rows; they never fall with deleted rows."""

    def __init__(self, labels: Sequence[str]) -> None:
        self._labels = labels
        self._lock = threading.Lock()
        self._last = Counts[tuple[str, ...]]()
        self._deleted = Counts[tuple[str, ...]]()

    def family(self, name: str, meaning: str, sums: Counts[tuple[str, ...]]) -> CounterMetricFamily:
        family = CounterMetricFamily(name, meaning, labels=self._labels)
        with self._lock:
            for labels in sorted(sums.keys() | self._last.keys()):
                self._deleted[labels] += max(0, self._last[labels] - sums[labels])
                family.add_metric(labels, sums[labels] + self._deleted[labels])
            self._last = Counts(sums)
        return family


def _states(statistics: Statistics) -> Iterator[Metric]:
    """Yields the number of campaigns and runs in each state."""
    for name, rows in (("campaigns", statistics.campaigns), ("runs", statistics.tallies)):
        family = GaugeMetricFamily(f"risk_sac_{name}", f"Stored {name} by state.", labels=["state"])
        for state in State:
            family.add_metric([state], sum(getattr(row, name) for row in rows if row.state == state))
        yield family
