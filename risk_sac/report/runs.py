"""Finished runs for the report: findings within budgets, play modes, failure kinds."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from risk_sac.config import FamilyName, RunMethod, RunSpec, method_of
from risk_sac.errors import ConfigError
from risk_sac.failures.studied import Studied, read_studies
from risk_sac.metrics import MetricsAccumulator, Tally, results_digest
from risk_sac.metrics.metric import outcome_features
from risk_sac.records import PHASES, Collision, EpisodeRecord, Grade, Outcome, Phase, Record, RunMetrics, Violation
from risk_sac.run_folder.results import EPISODES, Verified, read_results, read_verified, records_from_lines
from risk_sac.scenario.families import family_named
from risk_sac.verdicts.distinct import CELLS, taxonomy_cell, variant_name
from risk_sac.world.types import Floats


class Found(NamedTuple):
    """By one run's search."""

    headline: int  # failures; without a replay, those that may be
    preventable: int  # distinct violations
    distinct: int  # of those that are valid
    covered: int  # cells of the taxonomy


@dataclass(frozen=True, kw_only=True)
class FinishedRun:
    """A run's records, from which its report follows, and its processor time."""

    spec: RunSpec
    digest: str  # of the records
    records: tuple[EpisodeRecord, ...]  # failures of which the first of their kind does not repeat are refused
    versions: Mapping[str, str]
    wall_s: float
    cpu_s: float
    episode_cpu_s: tuple[float, ...] = ()  # to the end of each episode; none where it was not measured
    verified: Verified | None = None  # None where nothing was replayed
    studies: Mapping[int, Studied] = field(default_factory=dict)  # of its failures, by index of the episode

    @property
    def cell(self) -> tuple[FamilyName, RunMethod]:
        """Its cell in the table."""
        return self.spec.family, self.spec.method

    def phase(self, phase: Phase) -> tuple[EpisodeRecord, ...]:
        """Its episodes of one phase."""
        return tuple(record for record in self.records if record.phase == phase)

    @cached_property
    def metrics(self) -> Mapping[Phase, RunMetrics]:
        """The metrics of each phase that has episodes."""
        metrics_by_phase: dict[Phase, RunMetrics] = {}
        for phase in PHASES:
            accumulator = MetricsAccumulator(family_named(self.spec.family).horizon_steps)
            records = self.phase(phase)
            for record in records:
                accumulator.add(record)
            if records:
                metrics = accumulator.metrics()
                metrics_by_phase[phase] = self.verified.headlined(metrics, records) if self.verified else metrics
        return metrics_by_phase

    @cached_property
    def found(self) -> tuple[Found, ...]:
        """Counts of the search's findings after each of its episodes."""
        tally, findings = Tally(horizon_steps=family_named(self.spec.family).horizon_steps), []
        for record in self.phase("search"):
            tally.add(record)
            kinds = tally.headline_candidates, tally.distinct_preventable, tally.distinct_failures
            findings.append(Found(*kinds, len(tally.taxonomy)))
        return tuple(findings)


def versions_of(runs: Sequence[FinishedRun]) -> Mapping[str, str]:
    """Package → its version; all of them where runs differ."""
    names = sorted({name for run in runs for name in run.versions})
    return {name: ", ".join(sorted({run.versions[name] for run in runs if name in run.versions})) for name in names}


def read_run(folder: Path) -> FinishedRun:
    """Reads a finished run back.

    Raises:
      ConfigError: the folder holds none, or its episodes are not those that its digest was formed over.
      OSError: it cannot be read.
    """
    results = read_results(folder)
    if not results.finished or results.digest is None:
        raise ConfigError("", f"the run in {folder} is not finished", remedy="finish it with the command that began it")
    records = read_records(folder / EPISODES)
    if results_digest(records) != results.digest:
        raise ConfigError(
            "",
            f"{folder / EPISODES} does not hold the {len(results.failures)} failures and the other episodes that "
            f"digest {results.digest[:12]} was formed over",
            remedy="delete the folder and run it again",
        )
    verified = read_verified(folder, results.digest)
    return FinishedRun(
        spec=results.spec,
        digest=results.digest,
        records=verified.judged(records) if verified else records,
        versions=results.versions or {},
        wall_s=results.wall_s,
        cpu_s=results.cpu_s,
        episode_cpu_s=results.episode_cpu_s,
        verified=verified,
        studies=read_studies(folder, results.digest),
    )


def read_records(file: Path) -> tuple[EpisodeRecord, ...]:
    """Read a file of episodes, one JSON object per line."""
    content = file.read_bytes()
    try:
        return tuple(records_from_lines(content))
    except ValidationError as error:
        raise ConfigError("", f"{file} was not written by a run: {error.errors()[0]['msg']}") from error


NOTHING = Found(0, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Limit:
    """A budget."""

    name: str
    spent: Callable[[FinishedRun], Sequence[float]]  # after each search episode
    most: float


def episodes(run: FinishedRun) -> Sequence[float]:
    """1, 2, … for each search episode."""
    return range(1, len(run.phase("search")) + 1)


def cpu_s(run: FinishedRun) -> Sequence[float]:
    """Returns processor time to each search episode's end, s; empty if unmeasured."""
    return run.episode_cpu_s[: len(run.phase("search"))]


TESTED = Limit("30 CPU s", cpu_s, 30.0)
PAID_FOR = f"headline failures within {TESTED.name}"
LIMITS = (Limit("10 CPU s", cpu_s, 10.0), TESTED, Limit("300 episodes", episodes, 300.0))


def found_within(run: FinishedRun, limit: Limit) -> Found | None:
    """Counts the findings of episodes that ended within the limit.

    None if the search ended before the limit.
    """
    spent = limit.spent(run)
    if not spent or spent[-1] < limit.most:
        return None
    within = sum(after <= limit.most for after in spent)
    return run.found[within - 1] if within else NOTHING


class PlayedAs(StrEnum):
    """Parts of a scenario that a run changes.

    Each begins where the one before ends.
    """

    AS_WRITTEN = "the grid as written"
    SEARCHED = "its parameters searched"
    DEVIATING = "others deviate"


class FailureOrigin(Record):
    """A scenario's headline candidates that begin with one way to play it."""

    family: FamilyName
    played: PlayedAs
    methods: tuple[RunMethod, ...]
    episodes: int
    """Rejected scenes included."""
    rejected: int
    failures: int
    """Episodes with such a failure."""
    kinds: int
    new_kinds: int
    """Of these kinds, those that the ways before did not find."""
    least_speed_mps: float | None = None
    """Least deviation from the story that such an episode took: the largest of its actors' speeds. Null without
    deviations."""
    least_across_m: float | None = None
    """The same of their places across the road."""
    least_trigger_s: float | None = None
    """The same of shifts of their triggers."""


def played_as(method: RunMethod) -> PlayedAs | None:
    """Returns what a method changes of a scenario; None for storyless controls."""
    row = method_of(method)
    if row.story:
        return PlayedAs.AS_WRITTEN if row.scenes == "grid" else PlayedAs.SEARCHED
    return None if row.agent == "none" else PlayedAs.DEVIATING


def failure_origins(runs: Sequence[FinishedRun]) -> tuple[FailureOrigin, ...]:
    """Returns failures of scenarios that some method plays as written."""
    families = dict.fromkeys(run.spec.family for run in runs if method_of(run.spec.method).story)
    return tuple(row for family in families for row in _of_family([run for run in runs if run.spec.family == family]))


def _of_family(runs: Sequence[FinishedRun]) -> Iterable[FailureOrigin]:
    known = set[str]()
    for played in PlayedAs:
        own = [run for run in runs if played_as(run.spec.method) is played]
        if not own:
            continue
        records = [record for run in own for record in run.phase("search")]
        failing = {id(record): kinds for record in records if (kinds := _kinds(record))}
        kinds = set().union(*failing.values())
        deviating = [record for record in records if id(record) in failing and record.deviations]
        speeds = [max(each.speed_mps for each in record.deviations.values()) for record in deviating]
        across = [max(each.across_m for each in record.deviations.values()) for record in deviating]
        triggers = [max(each.trigger_s for each in record.deviations.values()) for record in deviating]
        yield FailureOrigin(
            family=own[0].spec.family,
            played=played,
            methods=tuple(dict.fromkeys(run.spec.method for run in own)),
            episodes=len(records),
            rejected=sum(record.outcome is Outcome.REJECTED for record in records),
            failures=len(failing),
            kinds=len(kinds),
            new_kinds=len(kinds - known),
            least_speed_mps=min(speeds, default=None),
            least_across_m=min(across, default=None),
            least_trigger_s=min(triggers, default=None),
        )
        known |= kinds


def _kinds(record: EpisodeRecord) -> set[str]:
    """Kinds of an episode's failures that may be headline failures."""
    return {violation.kind for violation in record.valid_violations if violation.headline_candidate}


SPEED_MPS, LEAST = 20.0, -3.0  # the same ranges for a violation without contact: of the ego's speed, and of robustness
WIDTH = 0.25  # kernel width as a share of the outcome features' ranges; failures farther apart are not much alike


class _Member(NamedTuple):
    """A violation of an episode."""

    name: str
    episode: EpisodeRecord
    violation: Collision | Violation


class Cluster(Record):
    """The failures of one kind."""

    name: str
    """The kind, in words."""
    failures: int
    variants: int
    """Different ones among them."""
    preventable: int
    """That a reference driver would have prevented."""
    published: int
    """Of these, those that R157, FSM or RSS would have prevented."""
    representative: str
    """Id of the one to look at first: the most preventable, and of those the shortest."""
    grade: Grade | None
    """Of that one."""


class Overview(Record):
    """Clusters, most preventable failures first, and how various they are."""

    clusters: tuple[Cluster, ...]
    vendi: float
    """Vendi score of the variants: as many that have nothing in common would be as various; 0 without any."""
    covered: int
    """Cells of the taxonomy of contacts with a failure in them."""
    cells: int
    """Of the taxonomy; most can hold nothing."""


def overview(episodes: Iterable[tuple[str, EpisodeRecord]]) -> Overview:
    """Sorts valid violations into clusters."""
    members_by_kind: defaultdict[str, list[_Member]] = defaultdict(list)
    taxonomy = set()
    for name, episode in episodes:
        for violation in episode.valid_violations:
            if isinstance(violation, Collision):
                taxonomy.add(taxonomy_cell(violation))
            members_by_kind[violation.kind].append(_Member(name, episode, violation))
    first_of_variants: dict[str, list[Collision | Violation]] = {}
    for name, members in members_by_kind.items():
        first: dict[str, Collision | Violation] = {}
        for member in members:
            first.setdefault(variant_name(member.violation), member.violation)
        first_of_variants[name] = list(first.values())
    clusters = [_cluster(name, members, len(first_of_variants[name])) for name, members in members_by_kind.items()]
    clusters.sort(key=lambda cluster: (-cluster.preventable, -cluster.failures, cluster.name))
    score = vendi(list(first_of_variants.values()))
    return Overview(clusters=tuple(clusters), vendi=score, covered=len(taxonomy), cells=CELLS)


def _cluster(name: str, members: Sequence[_Member], variants: int) -> Cluster:
    first = min(members, key=_rank)
    return Cluster(
        name=name,
        failures=len(members),
        variants=variants,
        preventable=sum(member.violation.preventable for member in members),
        published=sum(member.violation.published_preventable for member in members),
        representative=first.name,
        grade=first.violation.graded,
    )


def _rank(member: _Member) -> tuple[int, float, int]:
    """Returns what orders failures: grade, impact speed of R157's driver, length."""
    violation = member.violation
    grade = list(Grade).index(violation.graded) if violation.graded else len(Grade)
    judged = violation.judgement if isinstance(violation, Collision) else None
    r157 = judged and judged.drivers.get("r157")
    return grade, r157.impact_speed_mps if r157 else math.inf, member.episode.steps


def _features(violation: Collision | Violation) -> Floats:
    """Returns outcome features in [0, 1]; without contact, speed and robustness only."""
    if isinstance(violation, Collision):
        return outcome_features(violation)
    scaled: Floats = np.clip([violation.ego_speed_mps / SPEED_MPS, violation.robustness / LEAST], 0.0, 1.0)
    return scaled


def vendi(clusters: Sequence[Sequence[Collision | Violation]]) -> float:
    """Returns failures' Vendi score; different clusters have nothing in common.

    Within a cluster, similarity falls with the distance of their outcome features.

    Source: Friedman and Dieng, "The Vendi Score" (arXiv 2210.02410): exp of the entropy of the eigenvalues of K / n.
    """
    count = sum(map(len, clusters))
    entropy = 0.0
    for violations in clusters:  # K has a block for each
        features = np.array([_features(violation) for violation in violations])
        apart = ((features[:, None] - features) ** 2).sum(axis=2)
        shares = np.linalg.eigvalsh(np.exp(-apart / (2 * WIDTH**2))) / count
        shares = shares[shares > 0.0]
        entropy -= float((shares * np.log(shares)).sum())
    return math.exp(entropy) if count else 0.0
