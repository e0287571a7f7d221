"""Results of replaying a run's failures: cores and regions.

Each is a file beside the results.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError, computed_field

from risk_sac.errors import ConfigError
from risk_sac.metrics import wilson_interval
from risk_sac.records import Collision, EpisodeRecord, Record, Violation
from risk_sac.run_folder.durable import replace_file


class Extent(Record):
    """Amount of the adversaries' actions."""

    adversaries: int
    """That do anything but drive on as SUMO's drivers would, or walk on."""
    segments: int
    """Segments of 0.5 s of an adversary in which it does."""
    channels: int
    """Of these, drive and steering counted apart."""
    strongest: float
    """Greatest action, of 1."""


class Core(Record):
    """Minimised failure, and how surely it fails."""

    before: Extent
    after: Extent
    plain_parameters: int
    """Of the scene, in the middle of their ranges."""
    parameters: int
    """Without those that stand for one of two categories."""
    episodes: int
    """That were played to find it."""
    held: int
    """Copies, perturbed by up to 1 %, that still fail; other ones than those that the reductions were chosen by."""
    copies: int
    sentence: str
    """What happens, in words."""


def valid_failure(id_: str, episode: EpisodeRecord) -> Collision | Violation:
    """Returns the violation that names a valid failure; a ConfigError for others, which have no core or region."""
    violation = episode.worst_violation
    unjudged = isinstance(violation, Collision) and violation.judgement is None
    if violation is None or not violation.valid or unjudged:
        why = f": it breaks {episode.reason.replace('_', ' ')}" if episode.reason else ""
        raise ConfigError("FAILURE", f"{id_} is no valid failure{why}", remedy="choose one that is")
    return violation


NEEDLE = 0.5


class Share(Record):
    """Of the copies that differ from a failure in one way, those that fail as it does."""

    what: str
    """In which way they differ."""
    failed: int
    played: int
    low: float
    """Wilson's 95 % interval of the share."""
    high: float

    @classmethod
    def of(cls, what: str, failed: int, played: int) -> "Share":
        """With its interval."""
        low, high = wilson_interval(failed, played)
        return cls(what=what, failed=failed, played=played, low=low, high=high)


class Region(Record):
    """Surroundings of a failure; the shares in the order of `region`."""

    shares: tuple[Share, ...]

    @computed_field  # type: ignore[prop-decorator]
    @property
    def needle(self) -> bool:
        """Whether fewer than half of the nearest scenes fail: a failure that one would hardly meet again."""
        nearest = self.shares[0]
        return nearest.failed < NEEDLE * nearest.played


STUDIES = "studies"
_NAME = re.compile(r"([0-9]{1,9})-(?:core|region)\.json", re.ASCII)


class Studied(Record):
    """Studies of one failure; null where none was asked for."""

    core: Core | None = None
    region: Region | None = None


class _Note(Studied):
    """A file."""

    digest: str
    """Of the results."""


def note(folder: Path, digest: str, index: int, studied: Studied) -> None:
    """Writes the core or the region of a failure into a run's folder.

    The digest of the run's results goes with it.
    """
    file = folder / STUDIES / f"{index:06d}-{'region' if studied.core is None else 'core'}.json"
    file.parent.mkdir(exist_ok=True)
    replace_file(file, _Note(digest=digest, **dict(studied)).model_dump_json(indent=2).encode())


def edition(folder: Path) -> str:
    """Returns a text that changes whenever something is noted."""
    try:
        return " ".join(sorted(f"{file.name}:{file.stat().st_mtime_ns}" for file in (folder / STUDIES).glob("*.json")))
    except OSError:
        return ""


def read_studies(folder: Path, digest: str) -> Mapping[int, Studied]:
    """Reads the studies of results with this digest, by episode index.

    Damaged files are left out.
    """
    found: dict[int, Studied] = {}
    for file in sorted((folder / STUDIES).glob("*.json")):
        name = _NAME.fullmatch(file.name)
        try:
            noted = _Note.model_validate_json(file.read_bytes())
        except (OSError, ValidationError):
            continue
        if name is None or noted.digest != digest:
            continue
        before = found.get(int(name[1]), Studied())
        found[int(name[1])] = Studied(core=noted.core or before.core, region=noted.region or before.region)
    return found
