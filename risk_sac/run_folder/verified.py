"""Records which failures of a run repeat, in `verified.json` beside its results."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from risk_sac.errors import DamagedError
from risk_sac.records import REPEATS, DrivenBy, EpisodeRecord, Repetition, RunMetrics
from risk_sac.run_folder.durable import read_sealed, write_sealed
from risk_sac.run_folder.results import Results
from risk_sac.verdicts.distinct import DistinctFailures, Niche, kind_name, niche_of

VERIFIED = "verified.json"
TIMES = 3  # that a failure is replayed by default


@dataclass(frozen=True, kw_only=True)
class Verified:
    """The distinct failures of a run."""

    digest: str  # of the results
    code: str  # SHA-256 over the sources that replayed them
    versions: Mapping[str, str]  # of the packages that did
    episodes: Mapping[int, Repetition]  # by index

    @property
    def flaky(self) -> frozenset[int]:
        """The episodes that were not the same each time."""
        return frozenset(index for index, repetition in self.episodes.items() if not repetition.verified)

    def judged(self, records: Sequence[EpisodeRecord]) -> tuple[EpisodeRecord, ...]:
        """Marks violations that do not repeat as refused by that rule.

        So are violations like them in their phase, except in an episode that was replayed itself and does repeat.
        """
        if not self.flaky:
            return tuple(records)
        flaky = {kind for each in records if each.index in self.flaky for kind in _kinds(each)}
        repeating = self.episodes.keys() - self.flaky
        return tuple(
            each
            if each.index in repeating
            else each.refused(REPEATS, {name for kind, name in _kinds(each).items() if kind in flaky})
            for each in records
        )

    def headlined(self, metrics: RunMetrics, judged: Sequence[EpisodeRecord]) -> RunMetrics:
        """Adds the headline to the metrics of a phase, whose episodes are `judged`."""
        repeating = self.episodes.keys() - self.flaky
        first: dict[str, DrivenBy | None] = {}  # of a kind: what drove the episode
        for episode in judged:
            for each in episode.valid_violations if episode.index in repeating else ():
                if each.headline_candidate:
                    first.setdefault(kind_name(each), episode.driven_by)
        kinds = {"headline_kinds": tuple(first), "headline_kinds_driven_by": tuple(first.values())}
        return metrics.model_copy(update={"headline": len(first), **kinds})


def with_headline(results: Results, verified: Verified) -> Results:
    """The results of a run with the headline failures of each phase in its metrics."""
    judged = verified.judged([failure.episode for failure in results.failures])

    def told(metrics: RunMetrics | None, *, evaluating: bool) -> RunMetrics | None:
        episodes = [each for each in judged if each.evaluating is evaluating]
        return None if metrics is None else verified.headlined(metrics, episodes)

    return replace(
        results,
        metrics=told(results.metrics, evaluating=False),
        evaluation=told(results.evaluation, evaluating=True),
    )


def _kinds(episode: EpisodeRecord) -> Mapping[tuple[str, Niche], str]:
    """Phase and niche of each valid violation of an episode → its requirement."""
    return {(episode.phase, niche_of(each)): each.requirement for each in episode.valid_violations}


def distinct_failures(results: Results) -> list[EpisodeRecord]:
    """Selects episodes with the first failure of a kind in their phase.

    It is the first valid, the first preventable, or the first candidate.

    A candidate is one for the headline. The episodes come in their order.
    """
    found: defaultdict[tuple[str, str], DistinctFailures] = defaultdict(DistinctFailures)
    episodes = []
    for episode in (failure.episode for failure in results.failures):
        valid = episode.valid_violations
        new = [found[episode.phase, "valid"].add(each) for each in valid]
        new += [found[episode.phase, "preventable"].add(each) for each in valid if each.preventable]
        new += [found[episode.phase, "candidate"].add(each) for each in valid if each.headline_candidate]
        if any(new):
            episodes.append(episode)
    return episodes


def write_verified(folder: Path, verified: Verified) -> None:
    """Replaces the file in one step."""
    write_sealed(folder / VERIFIED, verified)


def read_verified(folder: Path, digest: str) -> Verified | None:
    """Reads what was found of the results with this digest.

    Returns None if nothing was, or if the file is damaged.
    """
    try:
        found = read_sealed(folder / VERIFIED, Verified)
    except (FileNotFoundError, DamagedError):
        return None
    return found if found.digest == digest else None
