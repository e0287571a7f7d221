"""Results of replaying failures: cores, regions, and verdicts of other egos.

Studies of a run's failures are files beside its results.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Literal

from pydantic import ValidationError, computed_field

from risk_sac.config import EgoConfig
from risk_sac.errors import ConfigError
from risk_sac.metrics import wilson_interval
from risk_sac.records import Collision, EpisodeRecord, Grade, Real, Record, State, Violation
from risk_sac.run_folder.durable import replace_file

Aim = Literal["smallest", "most-plausible"]
"""What a failure is minimised for."""


class Extent(Record):
    """Amount of the adversaries' actions."""

    adversaries: int
    """Adversaries that act: they do not only drive on as SUMO's drivers do, or walk on."""
    segments: int
    """Segments of 0.5 s in which an adversary acts."""
    channels: int
    """The same, with drive and steering counted apart."""
    strongest: float
    """Greatest action; at most 1."""


class Core(Record):
    """Minimised failure, and how often its perturbed copies fail."""

    before: Extent
    after: Extent
    plain_parameters: int
    """Parameters of the scene in the middle of their ranges."""
    parameters: int
    """Parameters of the scene, without those that choose one of two categories."""
    episodes: int
    """Episodes that were played to find it."""
    held: int
    """Copies, perturbed by up to 1 %, that still fail; no reduction was chosen by these copies."""
    copies: int
    sentence: str
    """What happens, in words."""


class PlausibleMotion(Record):
    """Motion that fails like a recorded one and is less unlikely."""

    before: Real
    """Unlikeliness of the recorded motion: -log p, summed over features and actors."""
    after: Real
    """The same of this motion."""
    episodes: int
    """Episodes that were played to find it."""
    held: int
    """Copies, perturbed by up to 1 %, that still fail."""
    copies: int
    sentence: str
    """What happens, in words."""


def valid_failure(id_: str, episode: EpisodeRecord) -> Collision | Violation:
    """Returns a valid failure's violation; raises a `ConfigError` for others."""
    violation = episode.worst_violation
    if violation is None or not violation.valid:
        why = f": it breaks {episode.reason.replace('_', ' ')}" if episode.reason else ""
        raise ConfigError("FAILURE", f"{id_} is no valid failure{why}", remedy="choose one that is")
    return violation


NEEDLE = 0.5


class Share(Record):
    """Share of copies with one difference from a failure that still fail."""

    what: str
    """The difference."""
    failed: int
    played: int
    low: float
    """Wilson's 95 % interval of the share."""
    high: float

    @classmethod
    def of(cls, what: str, failed: int, played: int) -> "Share":
        """Computes the interval of a share."""
        low, high = wilson_interval(failed, played)
        return cls(what=what, failed=failed, played=played, low=low, high=high)


class Region(Record):
    """Surroundings of a failure: shares of failing copies, the nearest first."""

    shares: tuple[Share, ...]

    @computed_field  # type: ignore[prop-decorator]
    @property
    def needle(self) -> bool:
        """Whether under half of the nearest scenes fail, so recurrence is unlikely."""
        nearest = self.shares[0]
        return nearest.failed < NEEDLE * nearest.played


STUDIES = "studies"
_NAME = re.compile(r"([0-9]{1,9})-(?:core|region)\.json", re.ASCII)


class Studied(Record):
    """Studies of one failure; null where none was asked for."""

    core: Core | None = None
    region: Region | None = None


class _Note(Studied):
    """File of studies."""

    digest: str
    """Of the run's results."""


def note(folder: Path, digest: str, index: int, studied: Studied) -> None:
    """Writes a failure's core or region with the results' digest."""
    file = folder / STUDIES / f"{index:06d}-{'region' if studied.core is None else 'core'}.json"
    file.parent.mkdir(exist_ok=True)
    replace_file(file, _Note(digest=digest, **dict(studied)).model_dump_json(indent=2).encode())


def edition(folder: Path) -> str:
    """Returns a text that changes with every write of a study."""
    try:
        return " ".join(sorted(f"{file.name}:{file.stat().st_mtime_ns}" for file in (folder / STUDIES).glob("*.json")))
    except OSError:
        return ""


def read_studies(folder: Path, digest: str) -> Mapping[int, Studied]:
    """Reads undamaged studies of results with this digest, by episode index."""
    studies: dict[int, Studied] = {}
    for file in sorted((folder / STUDIES).glob("*.json")):
        name = _NAME.fullmatch(file.name)
        try:
            noted = _Note.model_validate_json(file.read_bytes())
        except (OSError, ValidationError):
            continue
        if name is None or noted.digest != digest:
            continue
        before = studies.get(int(name[1]), Studied())
        studies[int(name[1])] = Studied(core=noted.core or before.core, region=noted.region or before.region)
    return studies


class Verdict(StrEnum):
    """Result of an old failure with another ego."""

    FIXED = "fixed"
    STILL_FAILING = "still_failing"
    NEW_KIND = "new_kind"  # another striker, type of conflict or requirement
    FLAKY = "flaky"  # not the same twice
    NOT_COMPARABLE = "not_comparable"


class Case(Record):
    """One failure, against the other ego."""

    id: str
    digest: str
    """Of its trajectory: failures of different campaigns, and a failure and its core, share an id."""
    name: str
    """Its kind, in words."""
    grade: Grade | None
    verdict: Verdict
    reason: str
    """In words: what happened instead, or why it cannot be compared."""
    found: str = ""
    """Signature of the failure that happens instead; empty where none does."""
    known: bool = False
    """Whether a baseline has it with the same verdict and the same failure instead."""

    @property
    def passed(self) -> bool:
        """Whether it passes: it is fixed, or known from the baseline."""
        return self.known or self.verdict is Verdict.FIXED

    @property
    def verdict_in_words(self) -> str:
        """The verdict, and whether the case was known."""
        return f"{_words(self.verdict)}{', known' if self.known else ''}"


def _words(verdict: Verdict) -> str:
    return verdict.replace("_", " ")


class Regression(Record):
    """All cases, in the order of the failures."""

    ego: EgoConfig
    cases: tuple[Case, ...]

    @property
    def passed(self) -> bool:
        """Whether all of them are fixed or known."""
        return all(case.passed for case in self.cases)

    @property
    def counts_in_words(self) -> str:
        """Counts the cases of each verdict, in words."""
        counts = Counter(_words(case.verdict) for case in self.cases)
        return ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))

    def beside(self, baseline: "Regression") -> "Regression":
        """Marks cases as known whose verdict and failure the baseline has.

        The reason of another case that does not pass tells why it is not known.
        """
        before = defaultdict[str, list[Case]](list)
        for case in baseline.cases:
            before[case.digest].append(case)
        return self.model_copy(update={"cases": tuple(_compared(case, before[case.digest]) for case in self.cases)})


def _compared(case: Case, before: Sequence[Case]) -> Case:
    if any((each.verdict, each.found) == (case.verdict, case.found) for each in before):
        return case.model_copy(update={"known": True})
    if case.passed:
        return case
    verdicts = sorted({_words(each.verdict) for each in before})
    if not verdicts:
        why = "the baseline does not have it"
    elif verdicts == [_words(case.verdict)]:
        why = "the baseline has another failure instead"
    else:
        why = f"in the baseline it is {' and '.join(verdicts)}"
    return case.model_copy(update={"reason": f"{case.reason}; {why}"})


class CampaignRegression(Record):
    """A campaign's distinct failures against another ego, played by the service."""

    id: str
    campaign_id: str
    ego: EgoConfig
    state: Literal[State.QUEUED, State.RUNNING, State.SUCCEEDED, State.FAILED] = State.QUEUED
    reason: str | None = None
    """Why it failed."""
    created_at: datetime
    finished_at: datetime | None = None
    cases: tuple[Case, ...] = ()
    """One for each distinct failure of each run."""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def passed(self) -> bool | None:
        """Whether all failures are fixed; null until it has succeeded."""
        return all(case.passed for case in self.cases) if self.state is State.SUCCEEDED else None
