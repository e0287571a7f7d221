"""Sorts failures into clusters by signature, and names one of each to look at first."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from risk_sac.metrics.features import outcome_features
from risk_sac.records import Collision, EpisodeRecord, Grade, Record
from risk_sac.verdicts.distinct import CELLS, distinct_failures, kind_of

WIDTH = 0.25  # of the outcome features' ranges: failures farther apart than that are not much alike


class Cluster(Record):
    """The failures of one signature."""

    name: str
    """The signature, in words."""
    failures: int
    distinct: int
    preventable: int
    """That the careful driver would have prevented."""
    representative: str
    """Id of the one to look at first: the most preventable, and of those the shortest."""
    grade: Grade | None
    """Of that one."""


class Overview(Record):
    """All clusters, the largest number of preventable failures first, and how various they are."""

    clusters: tuple[Cluster, ...]
    vendi: float
    """Vendi score of the distinct failures: as many that have nothing in common would be as various; 0 without any."""
    covered: int
    """Cells of the taxonomy with a failure in them."""
    cells: int
    """Of the taxonomy; most of them hold what no ego and no road allows."""


def overview(episodes: Iterable[tuple[str, EpisodeRecord]]) -> Overview:
    """Sorts failures into clusters; episodes without a valid, judged contact are left out."""
    found: defaultdict[str, list[tuple[str, EpisodeRecord, Collision]]] = defaultdict(list)
    kinds = set()
    for name, episode in episodes:
        collision = episode.collision
        if collision is None or not collision.valid or collision.judgement is None:
            continue
        found[collision.signature].append((name, episode, collision))
        kinds.add(kind_of(collision, collision.judgement))
    distinct = {}
    for name, members in found.items():
        collisions = [collision for *_, collision in members]
        distinct[name] = [collisions[position] for position in distinct_failures(collisions)]
    clusters = [_cluster(name, members, len(distinct[name])) for name, members in found.items()]
    clusters.sort(key=lambda cluster: (-cluster.preventable, -cluster.failures, cluster.name))
    score = vendi(list(distinct.values()))
    return Overview(clusters=tuple(clusters), vendi=score, covered=len(kinds), cells=CELLS)


def _cluster(name: str, members: Sequence[tuple[str, EpisodeRecord, Collision]], distinct: int) -> Cluster:
    first, _, collision = min(members, key=lambda member: _rank(member[1], member[2]))
    return Cluster(
        name=name,
        failures=len(members),
        distinct=distinct,
        preventable=sum(collision.preventable for *_, collision in members),
        representative=first,
        grade=collision.judgement.grade if collision.judgement else None,
    )


def _rank(episode: EpisodeRecord, collision: Collision) -> tuple[int, float, int]:
    """Returns what orders failures: grade, impact speed of the careful driver, length."""
    assert collision.judgement is not None
    judged = collision.judgement
    grade = list(Grade).index(judged.grade) if judged.grade else len(Grade)
    careful = judged.drivers.get("careful")
    return grade, careful.impact_speed_mps if careful else math.inf, episode.steps


def vendi(clusters: Sequence[Sequence[Collision]]) -> float:
    """Returns the Vendi score of failures; those in different clusters have nothing in common.

    Within a cluster, similarity falls with the distance of their outcome features.

    Source: Friedman and Dieng, "The Vendi Score" (arXiv 2210.02410): exp of the entropy of the eigenvalues of K / n.
    """
    count = sum(map(len, clusters))
    entropy = 0.0
    for collisions in clusters:  # K has a block for each
        features = np.array([outcome_features(collision) for collision in collisions])
        apart = ((features[:, None] - features) ** 2).sum(axis=2)
        shares = np.linalg.eigvalsh(np.exp(-apart / (2 * WIDTH**2))) / count
        shares = shares[shares > 0.0]
        entropy -= float((shares * np.log(shares)).sum())
    return math.exp(entropy) if count else 0.0
