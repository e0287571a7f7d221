"""Time series, pictures, roads, twins and studies of failures; episode tables.

Helper processes play studies, which need the simulator, and write tables, which need packages of 150 MB.
"""

import contextlib
import hashlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac import __version__
from risk_sac.config import EgoConfig
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.execution.helper import ANSWER, QUESTION
from risk_sac.execution.messages import without_folders
from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.net import RoadsBody, roads_of, signal_heads, thumbnail
from risk_sac.failures.question import IDLE, REFUSED, Question, Subject, Twin, read_twin
from risk_sac.failures.recording import Recording
from risk_sac.failures.studied import valid_failure
from risk_sac.records import Collision, Episode, Failure, Record, Triage
from risk_sac.run_folder.arrays import read_limited, unpack_arrays
from risk_sac.run_folder.results import FAILURES, RESULTS, RecordedFailure
from risk_sac.scenario.bodies import body_of
from risk_sac.world.types import Kind, Role, Series, Signal
from service.errors import NotPlayable, OutdatedError, SeriesLost, StorageError
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign, StoredFailure, StoredRun
from service.views.on_demand import WALL_S, Helper, OnDemandCache

_NAMED = {"kind": Kind, "role": Role, "signal": Signal}


def failure_body(campaign_id: str, failure: StoredFailure, triage: Triage | None, settings: ServiceSettings) -> Failure:
    """Returns a failure with triage and series, or why there is none."""
    series, problem = None, None
    try:
        series = load_series(*series_file(campaign_id, failure, settings))
    except SeriesLost as error:
        problem = str(error)
    return Failure(**dict(failure.episode), series=series, series_problem=problem, triage=triage)


def series_file(campaign_id: str, failure: StoredFailure, settings: ServiceSettings) -> tuple[Path, str | None]:
    """Returns path and SHA-256 of a failure's series; SeriesLost if none."""
    if failure.series is None:
        raise SeriesLost("no time series was recorded")
    folder = settings.run_folder(campaign_id, failure.episode.run_id) / FAILURES
    return folder / failure.series, failure.series_sha256


def load_series(path: Path, sha256: str | None) -> Series:
    """Returns the series as a body; raises SeriesLost if unreadable or damaged."""
    arrays = load_arrays(path, sha256)
    try:
        return series_body(arrays)
    except (ValueError, TypeError, OverflowError) as error:  # pydantic's, too
        raise SeriesLost(f"the time series {path.name!r} is damaged: {str(error).partition(chr(10))[0]}") from error


def series_body(arrays: Mapping[str, NDArray[Any]]) -> Series:
    """Returns the public arrays as a body, with None for non-finite numbers."""
    told = arrays.keys() & Series.model_fields.keys()
    return Series.model_validate({name: _plain(name, arrays[name]) for name in told})


def load_arrays(path: Path, sha256: str | None) -> dict[str, NDArray[Any]]:
    """The series as its worker wrote it, an .npz of arrays.

    Args:
      path: the file.
      sha256: of its content, as its worker told; None: not checked.

    Raises:
      SeriesLost: the file is missing, too large, not the one that was written, or lacks an array.
    """
    try:
        content = read_limited(path)
        _verify(path, content, sha256)
        arrays = unpack_arrays(content)
        names = (name for name, field in Series.model_fields.items() if field.is_required() or name in arrays)
        return {name: arrays[name] for name in names}
    except FileNotFoundError as error:
        raise SeriesLost(f"the time series {path.name!r} is gone") from error
    except (OSError, KeyError, DamagedError) as error:
        raise SeriesLost(f"the time series {path.name!r} is damaged: {error}") from error


def _verify(path: Path, content: bytes, sha256: str | None) -> None:
    actual = hashlib.sha256(content).hexdigest()
    if sha256 is not None and actual != sha256:
        raise SeriesLost(f"the time series {path.name!r} is damaged: its SHA-256 is {actual}, wanted {sha256}")


def _letter(value: float | str) -> str | None:
    """SUMO's letter of a signal, which may be written as its number."""
    if isinstance(value, str):
        return value or None
    return chr(int(value)) if value > 0 else None


def _plain(name: str, array: NDArray[Any]) -> Any:
    if name == "link":
        return [[_letter(each) for each in row] for row in array.tolist()]
    if name in _NAMED:
        return [_NAMED[name](int(value)).name.lower() for value in array]
    if name == "body":
        return [body_of(code).name for code in array.tolist()]
    if array.dtype.kind == "f":
        missing = ~np.isfinite(array)
        array = array.astype(object)
        array[missing] = None
    return array.tolist()


MM = 3  # decimals of a metre


@dataclass(frozen=True, slots=True)
class FailureOfARun:
    """A failure; two with the same edition look the same."""

    edition: str  # changes whenever its pictures would
    campaign: StoredCampaign = field(compare=False)
    run: StoredRun = field(compare=False)
    stored: StoredFailure = field(compare=False)

    @property
    def episode(self) -> Episode:
        """The episode that ended in it."""
        return self.stored.episode

    @classmethod
    def of(cls, campaign: StoredCampaign, stored: StoredFailure) -> "FailureOfARun":
        """A failure of a campaign."""
        episode = stored.episode
        run = next(run for run in campaign.runs if run.id == episode.run_id)
        # The run's digest: what is made of a run that has ended holds its policy too.
        told = (str(run.digest), str(stored.series_sha256), episode.model_dump_json())
        parts = (__version__, campaign.id, episode.id, *told)
        edition = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]
        return cls(edition, campaign, run, stored)


def recording_of(failure: FailureOfARun, settings: ServiceSettings) -> Recording:
    """Returns the recording to draw; SeriesLost if its time series is lost."""
    episode = failure.episode
    path, sha256 = series_file(failure.campaign.id, failure.stored, settings)
    arrays = load_arrays(path, sha256)
    return Recording(RecordedFailure(id=episode.id, series=path.name, episode=episode), arrays)


@dataclass(frozen=True, slots=True)
class Picture:
    """Key of a picture: a failure, and optionally its twin."""

    failure: FailureOfARun
    twin: Twin | None = None
    """What is drawn beside it."""
    played: bytes = field(default=b"", compare=False)
    """That twin as a study told it."""


def pictures(settings: ServiceSettings) -> OnDemandCache[Picture]:
    """PNGs of failures; SeriesLost where the time series is lost."""

    def draw(picture: Picture) -> bytes:
        from risk_sac.failures.show import recording_bytes  # here, because it loads matplotlib

        recording, twin = recording_of(picture.failure, settings), None
        if picture.twin is not None:
            told, series = read_twin(picture.played)
            twin = replace(recording, series=series, twin=told.title)
        return recording_bytes(picture.failure.run.family, recording, "png", twin)

    return OnDemandCache(draw, "pictures")


class TwinBody(Record):
    """The scene of a failure, played with one thing changed."""

    twin: Twin
    """`idle`: no adversary attacks; else the profile of another ego."""
    outcome: str
    """In words."""
    collision: Collision | None
    """Null without a contact."""
    series: Series
    """From the same start as the failure's own, up to 3 s after it, or until a contact."""


def roads_body(failure: FailureOfARun) -> RoadsBody:
    """Returns the surfaces and signals of a failure's scene."""
    place = failure.run.family, failure.episode.scene
    return RoadsBody.of(roads_of(*place), MM, signal_heads(*place))


def thumbnail_of(failure: FailureOfARun, settings: ServiceSettings) -> str:
    """Returns a failure as small SVG; SeriesLost without its time series."""
    place = failure.run.family, failure.episode.scene
    return thumbnail(recording_of(failure, settings), roads_of(*place), signal_heads(*place))


def twin_body(twin: Twin, played: bytes) -> TwinBody:
    """A twin, as a study played it, with its full time series."""
    told, arrays = read_twin(played)
    return TwinBody(twin=twin, outcome=told.outcome, collision=told.collision, series=series_body(arrays))


logger = logging.getLogger(__name__)

MISUSED = 2  # exit status of `risk-sac` for what cannot be used
STUDIES_AT_ONCE = 2  # the long ones of one key hold up no other key
TABLES_KEPT = 1  # of some megabytes each


@dataclass(frozen=True, slots=True)
class Study:
    """A question about a failure."""

    failure: FailureOfARun
    subject: Subject
    twin: Twin | None = None
    """Of a twin: which."""
    format: FormatName | None = None
    """Of an export: which."""


class Studies(OnDemandCache[Study]):
    """Studies, one at a time per key; raises SeriesLost or NotPlayable."""

    def __init__(self, settings: ServiceSettings, helper: Helper) -> None:
        super().__init__(self._answer, "failures", at_once=STUDIES_AT_ONCE)
        self._settings, self._helper = settings, helper

    async def get(self, subject: Study, key_id: str | None) -> bytes:
        """Returns the study; cores, motions and regions require a valid failure."""
        if subject.subject in ("core", "most-plausible", "region"):
            episode = subject.failure.episode
            try:
                valid_failure(episode.id, episode)
            except ConfigError as error:
                raise NotPlayable(error.got) from error
        return await super().get(subject, key_id)

    def _answer(self, study: Study) -> bytes:
        failure = study.failure
        path, sha256 = series_file(failure.campaign.id, failure.stored, self._settings)
        load_arrays(path, sha256)  # raises where it is lost or damaged
        try:
            spec = failure.campaign.run_spec(failure.run)
        except OutdatedError as error:
            raise NotPlayable(str(error)) from error
        question = Question(
            subject=study.subject,
            spec=spec,
            episode=failure.episode,
            series=path,
            format=study.format,
            twin=None if study.twin in (None, IDLE) else EgoConfig.model_validate({"profile": study.twin}),
        )
        asked = question.model_dump_json().encode()
        result = self._helper.run("risk_sac.failures.study", [QUESTION, ANSWER], asked)
        if result.timed_out:
            raise NotPlayable(f"it takes more than {WALL_S:g} s here")
        if result.status == REFUSED:
            raise NotPlayable(without_folders(result.answer.decode(errors="replace"), path.parent))
        if result.status != 0:
            logger.error("a study ended with status %d: %s", result.status, result.log)
            raise NotPlayable("its process was lost; the log has the reason")
        return result.answer


@dataclass(frozen=True, slots=True)
class EpisodeTable:
    """The episodes in folders of runs, as they are at a time."""

    folders: tuple[Path, ...]
    written_ns: tuple[int, ...]
    """When the results of each run were."""
    format: FormatName

    @classmethod
    def of(cls, folders: Sequence[Path], format: FormatName) -> "EpisodeTable":
        """The table of those runs that have results by now."""
        written_ns = {}
        for folder in folders:
            with contextlib.suppress(FileNotFoundError):
                written_ns[folder] = (folder / RESULTS).stat().st_mtime_ns
        return cls(tuple(written_ns), tuple(written_ns.values()), format)


class EpisodeTables(OnDemandCache[EpisodeTable]):
    """Tables, made one at a time; StorageError where one cannot be made."""

    def __init__(self, helper: Helper) -> None:
        super().__init__(self._written, "tables", TABLES_KEPT)
        self._helper = helper

    def _written(self, table: EpisodeTable) -> bytes:
        folders = map(str, table.folders)
        result = self._helper.run("risk_sac", ["export", *folders, "--format", table.format, "--out", ANSWER])
        if result.status != 0:
            logger.error("a table of episodes was not made (status %d): %s", result.status, result.log)
            reason = f"it takes more than {WALL_S:g} s" if result.timed_out else "the log has the reason"
            for folder in table.folders:  # a file of a run may be damaged or gone
                if result.status == MISUSED and f"{folder}/" in result.log:
                    reason = f"run {folder.name}: " + result.log.partition(f"{folder}/")[2].splitlines()[0]
            rest = "`episodes` of the campaign still lists them all"
            raise StorageError(f"the table of episodes cannot be made: {without_folders(reason)}; {rest}")
        return result.answer
