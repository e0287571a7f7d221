"""Sorts failures into clusters by kind, and names one of each to look at first."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from risk_sac.metrics.metric import outcome_features
from risk_sac.records import Collision, EpisodeRecord, Grade, Record, Violation
from risk_sac.verdicts.distinct import CELLS, taxonomy_cell, variant_name
from risk_sac.world.types import Floats

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
    """All clusters, the largest number of preventable failures first, and how various they are."""

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
    """Outcome features, scaled to [0, 1]; a violation without contact has the ego's speed and the robustness alone."""
    if isinstance(violation, Collision):
        return outcome_features(violation)
    scaled: Floats = np.clip([violation.ego_speed_mps / SPEED_MPS, violation.robustness / LEAST], 0.0, 1.0)
    return scaled


def vendi(clusters: Sequence[Sequence[Collision | Violation]]) -> float:
    """Returns the Vendi score of failures; those in different clusters have nothing in common.

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
