"""Scripts of an earlier run or campaign, from which a search goes on.

They are copied under a name that holds their digest into the folder `priors` of the library of places. So a run that
is resumed starts from what it started from at first, whatever became of its source.
"""

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Self

from pydantic import ValidationError

from risk_sac.errors import ConfigError, DamagedError
from risk_sac.host.machine import UNWRITABLE
from risk_sac.records import EpisodeRecord, Outcome, worst_of
from risk_sac.run_folder.durable import LOCK, lock, read_sealed, replace_file, seal
from risk_sac.run_folder.results import EPISODES, RESULTS, read_results
from risk_sac.scenario.families import family_named
from risk_sac.scenario.library import library
from risk_sac.verdicts.distinct import variant_name

FOLDER = "priors"
KEPT = re.compile(r"[a-z0-9_]{0,41}[0-9a-f]{12}")
MOST_FAILURES, LATEST = 300, 300  # of a family
PLAYED = (Outcome.SAFE, Outcome.DEGENERATE, Outcome.FAILURE)
SHIPPED_OR_NONE = ("shipped", "none")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedScript:
    """A scene and a script that a run played, and how the episode ended."""

    scene: Mapping[str, float]
    genes: tuple[float, ...]
    kind: str = ""  # name of the variant of its valid violation; empty: there was none
    candidate: bool = False  # for the headline

    @classmethod
    def of(cls, record: EpisodeRecord) -> Self:
        """Returns the script of an episode that followed one."""
        worst = worst_of(record.valid_violations)
        return cls(
            scene=record.scene,
            genes=record.script or (),
            kind="" if worst is None else variant_name(worst),
            candidate=worst is not None and worst.headline_candidate,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyScripts:
    """Scripts that runs of one family played."""

    adversaries: tuple[str, ...]  # those of the shipped family that they stand for
    mirrored: bool
    like: str | None  # shipped family whose prior fits
    failures: tuple[PlayedScript, ...]  # one of each variant first, and candidates for the headline before others
    latest: tuple[PlayedScript, ...]  # whatever they ended in

    @classmethod
    def of(cls, family: str, records: Iterable[EpisodeRecord]) -> Self:
        """Selects from a family's episodes in the order in which they were played."""
        played = [PlayedScript.of(each) for each in records if each.script and each.outcome in PLAYED]
        rank, places = Counter[str](), []
        for number, each in sorted(enumerate(played), key=lambda pair: not pair[1].candidate):
            if each.kind:
                places.append((rank[each.kind], not each.candidate, number))
                rank[each.kind] += 1
        failures = [played[number] for *_, number in sorted(places)[:MOST_FAILURES]]
        of = family_named(family)
        return cls(
            adversaries=of.stand_ins,
            mirrored=of.mirrored,
            like=of.like.family if of.like else None,
            failures=tuple(failures),
            latest=tuple(played[-LATEST:]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class EarlierScripts:
    """Scripts of a run, or of a campaign's runs, by family."""

    families: Mapping[str, FamilyScripts]

    def alike(self, family: str) -> tuple[FamilyScripts, ...]:
        """Returns the scripts of this family, or else of those like it.

        Families are alike that are like the same shipped one.
        """
        if family in self.families:
            return (self.families[family],)
        like = family_named(family).like
        return tuple(found for found in self.families.values() if like is not None and found.like == like.family)


def pinned_prior(prior: str, families: Sequence[str]) -> str:
    """Copies the scripts that a prior names; returns the copy's name, or `shipped` or `none` as it is.

    Args:
      prior: the folder of a run or campaign, or what this returned.
      families: that are to be searched.

    Raises:
      ConfigError: there is no such run, it followed no scripts, or is like another family.
    """
    if prior in SHIPPED_OR_NONE:
        return prior
    return keep(prior, PriorContent.read(prior, None if is_kept(prior) else Path(prior)).checked(prior, families))


def is_kept(prior: str) -> bool:
    """Whether a prior names a copy that `keep` has made."""
    return KEPT.fullmatch(prior) is not None and _path(prior).exists()


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorContent:
    """Scripts as they are copied, of which a server reads the families alone."""

    families: Mapping[str, str | None]  # family → the shipped one whose prior fits
    sealed: str

    @classmethod
    def read(cls, prior: str, folder: Path | None) -> Self:
        """Reads the scripts of a run's or campaign's folder, or of the copy that the prior names."""
        scripts = kept(prior) if folder is None else _taken(prior, folder)
        families = {family: found.like for family, found in scripts.families.items()}
        return cls(families=families, sealed=seal(scripts).decode())

    def checked(self, prior: str, families: Sequence[str]) -> Self:
        """Raises ConfigError for a family without scripts.

        Scripts of a family that is like the same shipped one will do.
        """
        for family in families:
            like = None if family in self.families else family_named(family).like
            if family not in self.families and (like is None or like.family not in self.families.values()):
                got = f"{prior}, whose runs are of {', '.join(self.families)}"
                wanted = f"one with a run of {family}" + (f", or of a scenario like {like.family}" if like else "")
                raise ConfigError("prior", got, wanted)
        return self


def kept(name: str) -> EarlierScripts:
    """Reads scripts that `keep` has copied.

    Raises:
      ConfigError: there is no such copy.
      DamagedError: it is not as it was written.
    """
    path = _path(name)
    if KEPT.fullmatch(name) is None or not path.exists():
        raise ConfigError("prior", f"{name!r}", "shipped, none, or an earlier run or campaign")
    if not name.endswith(_digest(path.read_bytes())):
        raise DamagedError(f"the prior {name!r} in {path.parent} is damaged; name its run once more")
    return read_sealed(path, EarlierScripts)


def prune(places: Path, named: Callable[[], Collection[str]], before: float) -> None:
    """Removes copies from a service's library that no campaign names.

    Args:
      places: the library.
      named: returns the names of those that stay; asked if there are old copies.
      before: when a copy was last made for it to be old, s since the epoch.
    """
    old = [path for path in (places / FOLDER).glob("*.json") if path.stat().st_mtime < before]
    stay = named() if old else ()
    for path in old:
        if path.stem not in stay:
            path.unlink()


def file_of(name: str) -> Path:
    """Returns the file of a copy, relative to the library of places."""
    return Path(FOLDER, f"{name}.json")


def _taken(prior: str, folder: Path) -> EarlierScripts:
    """Reads the scripts of a run's folder or of all runs in a campaign's folder.

    Raises:
      ConfigError: there is no run, one cannot be read, or none followed scripts.
    """
    runs: dict[str, list[Path]] = {}
    for run in _runs(folder):
        with _readable(prior, run):
            runs.setdefault(read_results(run).spec.family, []).append(run)
    if not runs:
        raise ConfigError("prior", f"{prior!r}", "shipped, none, or an earlier run or campaign")
    scripts = {
        family: FamilyScripts.of(family, chain.from_iterable(_records(prior, run) for run in of_family))
        for family, of_family in runs.items()
    }
    scripts = {family: found for family, found in scripts.items() if found.latest}
    if not scripts:
        remedy = "name a run of risk-sac-diverse, archive or archive-replay"
        raise ConfigError("prior", f"{prior}, whose episodes followed no scripts", "one that did", remedy)
    return EarlierScripts(families=scripts)


def _records(prior: str, run: Path) -> Iterator[EpisodeRecord]:
    """Yields the episodes of a run; a record takes several times the memory of its script."""
    with _readable(prior, run), (run / EPISODES).open("rb") as lines:
        for line in lines:
            yield EpisodeRecord.model_validate_json(line)


@contextmanager
def _readable(prior: str, run: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, ValidationError, ConfigError) as error:
        raise ConfigError("prior", f"{prior}, whose run {run.name} cannot be read", "one that is whole") from error


def _runs(folder: Path) -> Iterator[Path]:
    """Yields the folders of runs: this one, or a campaign's.

    The campaign is by the command line or the service.
    """
    for file in (folder / RESULTS, *sorted(folder.glob(f"runs/*/{RESULTS}")), *sorted(folder.glob(f"*/{RESULTS}"))):
        if file.is_file() and (file.parent / EPISODES).is_file():
            yield file.parent


def keep(prior: str, prior_content: PriorContent) -> str:
    """Copies what a prior names into the library; returns the copy's name.

    Raises:
      ConfigError: the library cannot be written.
      OSError: its disk fails.
    """
    if is_kept(prior):
        _path(prior).touch()  # it is wanted again: see `prune`
        return prior
    content = prior_content.sealed.encode()
    label = re.sub("[^a-z0-9]+", "_", Path(prior).name.lower()).strip("_")
    name = "_".join(filter(None, (label[:40].strip("_"), _digest(content))))
    path = _path(name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with lock(path.parent / LOCK, wait=True):  # `replace_file` has one writer at a time
            replace_file(path, content)
    except OSError as error:
        if error.errno not in UNWRITABLE:
            raise
        got = f"{path.parent}, which cannot be written ({error.strerror})"
        raise ConfigError("prior", got, "a folder that can be written") from error
    return name


def _path(name: str) -> Path:
    return library() / file_of(name)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:12]
