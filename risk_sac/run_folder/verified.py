"""Which failures of a run repeat: `verified.json` in its folder, beside the results that it speaks of."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic.dataclasses import dataclass

from risk_sac.errors import DamagedError
from risk_sac.records import REPEATS, EpisodeRecord, Outcome, Repetition
from risk_sac.run_folder.durable import read_sealed, write_sealed
from risk_sac.run_folder.results import Results
from risk_sac.verdicts.distinct import DistinctFailures, niche_of

VERIFIED = "verified.json"
TIMES = 3  # that a failure is replayed, if nobody says otherwise


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
        """A run's episodes; failures that do not repeat are refused by that rule, and those like them in their phase.

        One that was replayed itself and does repeat stays.
        """
        if not self.flaky:
            return tuple(records)
        kinds = {each.index: (each.phase, niche_of(each.collision)) for each in records if each.collision}
        flaky = {kinds[index] for index in self.flaky if index in kinds}
        repeating = self.episodes.keys() - self.flaky
        return tuple(
            each.refused(REPEATS)
            if each.outcome is Outcome.FAILURE and kinds[each.index] in flaky and each.index not in repeating
            else each
            for each in records
        )


def distinct_failures(results: Results) -> list[EpisodeRecord]:
    """The first failure of each kind in each phase, and the first preventable one, in the order of the episodes."""
    found: defaultdict[tuple[str, bool], DistinctFailures] = defaultdict(DistinctFailures)
    episodes = []
    for episode in (contact.episode for contact in results.contacts):
        collision = episode.collision
        if collision is None or not collision.valid:
            continue
        new = found[episode.phase, False].add(collision)
        new_preventable = collision.preventable and found[episode.phase, True].add(collision)
        if new or new_preventable:
            episodes.append(episode)
    return episodes


def write_verified(folder: Path, verified: Verified) -> None:
    """Replaces the file in one step."""
    write_sealed(folder / VERIFIED, verified)


def read_verified(folder: Path, digest: str) -> Verified | None:
    """What was found of the results with this digest; None if nothing was, or if the file is damaged."""
    try:
        found = read_sealed(folder / VERIFIED, Verified)
    except (FileNotFoundError, DamagedError):
        return None
    return found if found.digest == digest else None
