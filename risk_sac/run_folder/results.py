"""Files of a run's folder, under `risk-sac run` and in the service alike.

results.json    the spec, the metrics and every failure, sealed; rewritten at each checkpoint and at the end
episodes.jsonl  one `EpisodeRecord` per line; the digest in results.json is formed over them
failures/       the time series of every failure, see `risk_sac.run_folder.series`
verified.json   which failures repeated, see `risk_sac.run_folder.verified`; sealed
studies/        cores and regions that were asked for, see `risk_sac.failures.studied`
checkpoint      from which the run goes on; beside it the one before, `checkpoint.previous`
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.records import Adjustment, EpisodeId, EpisodeRecord, RunMetrics
from risk_sac.run_folder.durable import read_sealed, write_sealed

RESULTS = "results.json"
EPISODES = "episodes.jsonl"
FAILURES = "failures"


def series_name(index: int) -> str:
    """File in `failures/` that holds the time series of an episode."""
    return f"{index:06d}.npz"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedFailure:
    """An episode in which a requirement that counts was violated, with or without contact, refused ones included."""

    id: str  # the episode's, as the service says it too
    series: str  # file of its time series, relative to results.json
    episode: EpisodeRecord

    @classmethod
    def of(cls, run_id: str, episode: EpisodeRecord) -> "RecordedFailure":
        """The failure of an episode, its file named as the run names it."""
        return cls(id=episode.id_in(run_id), series=f"{FAILURES}/{series_name(episode.index)}", episode=episode)


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Results of one run."""

    spec: RunSpec
    spec_digest: str
    adjustments: tuple[Adjustment, ...] = ()  # of the spec, in what the episodes use
    finished: bool
    metrics: RunMetrics | None = None  # of the search or the i.i.d. phase; None before its first episode
    evaluation: RunMetrics | None = None  # of the frozen policy
    digest: str | None = None  # of all records; None while the run goes on
    versions: Mapping[str, str] | None = None
    device: str | None = None  # where the networks lived; None while the run goes on
    wall_s: float = 0.0  # over all resumes
    cpu_s: float = 0.0  # the same in processor time
    episode_cpu_s: tuple[float, ...] = ()  # to the end of each; none while it goes on
    failures: tuple[RecordedFailure, ...] = ()  # in the order of the episodes

    def failure(self, id_: str) -> RecordedFailure:
        """Finds a failure by its id or its episode number.

        The id may stand with or without the run's id in front.
        """
        wanted = EpisodeId.parse(id_)
        for failure in self.failures:
            episode = failure.episode
            known = [EpisodeId(run_id, episode.phase, episode.index) for run_id in (self.spec.id, "")]
            if wanted in known or (id_.isdecimal() and int(id_) == episode.index):
                return failure
        if not self.failures:
            raise ConfigError("FAILURE", f"{id_!r}", remedy="the run has no failures")
        first, last = (self.failures[place].episode for place in (0, -1))
        expected = f"one of {len(self.failures)} failures with numbers from {first.index} to {last.index}"
        raise ConfigError("FAILURE", f"{id_!r}", expected, "`risk-sac show RESULTS --raw` lists them")


def write_results(folder: Path, results: Results) -> None:
    """Replaces results.json in one step."""
    write_sealed(folder / RESULTS, results)


def read_results(path: Path) -> Results:
    """Reads results.json, or the one in a folder; raises `ConfigError` if it is missing or damaged."""
    file = path / RESULTS if path.is_dir() else path
    try:
        return read_sealed(file, Results)
    except FileNotFoundError as error:
        raise ConfigError("RESULTS", f"there is no {file}", remedy="name the folder of a run") from error
    except DamagedError as error:
        raise ConfigError("RESULTS", str(error)) from error


def records_from_lines(content: bytes) -> list[EpisodeRecord]:
    """The records of an episodes.jsonl."""
    return [EpisodeRecord.model_validate_json(line) for line in content.splitlines()]
