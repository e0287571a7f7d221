"""Files of a run's folder, the same in CLI and service.

results.json    the spec, the metrics and every failure, sealed; rewritten at each checkpoint and at the end
episodes.jsonl  one `EpisodeRecord` per line; the digest in results.json is formed over them
failures/       the time series of every failure, see `risk_sac.run_folder.series`
verified.json   which failures repeated, see `risk_sac.run_folder.results`; sealed
boundary.json   the map of a run of the method `boundary`, once it has ended.
boundary.png    the picture of that map
rates.json      the failure rates of a run of the method `rate`, once it has ended.
studies/        cores and regions that were asked for, see `risk_sac.failures.studied`
checkpoint      from which the run goes on; beside it the one before, `checkpoint.previous`
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.records import REPEATS, Adjustment, DrivenBy, EpisodeId, EpisodeRecord, Repetition, RunMetrics
from risk_sac.records.rates import BoundaryMap, Rates
from risk_sac.run_folder.durable import read_sealed, replace_file, sealed_pieces, write_sealed
from risk_sac.verdicts.distinct import variant_name

RESULTS = "results.json"
EPISODES = "episodes.jsonl"
FAILURES = "failures"
BOUNDARY, BOUNDARY_PICTURE, RATES = "boundary.json", "boundary.png", "rates.json"


def series_name(index: int) -> str:
    """File in `failures/` that holds the time series of an episode."""
    return f"{index:06d}.npz"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedFailure:
    """Episode that violated a requirement that counts, refused violations included."""

    id: str  # the episode's, as the service says it too
    series: str  # file of its time series, relative to results.json
    episode: EpisodeRecord

    @classmethod
    def of(cls, run_id: str, episode: EpisodeRecord) -> "RecordedFailure":
        """Returns the failure of an episode, with its series file's name."""
        return cls(id=episode.id_in(run_id), series=f"{FAILURES}/{series_name(episode.index)}", episode=episode)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResults:
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
    processes: int = 1  # that played its episodes when it was run last, at most so many at a time
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


def write_results(folder: Path, results: RunResults, failures: Iterable[RecordedFailure] | None = None) -> None:
    """Replaces results.json in one step.

    `failures` stand in for those of the results, with one in memory at a time.
    """
    rows = results.failures if failures is None else failures
    replace_file(folder / RESULTS, sealed_pieces(replace(results, failures=()), rows))


def read_results(path: Path) -> RunResults:
    """Reads results.json, or a folder's; raises `ConfigError` if missing or damaged."""
    file = path / RESULTS if path.is_dir() else path
    try:
        return read_sealed(file, RunResults)
    except FileNotFoundError as error:
        raise ConfigError("RESULTS", f"there is no {file}", remedy="name the folder of a run") from error
    except DamagedError as error:
        raise ConfigError("RESULTS", str(error)) from error


def records_from_lines(content: bytes) -> list[EpisodeRecord]:
    """The records of an episodes.jsonl."""
    return [EpisodeRecord.model_validate_json(line) for line in content.splitlines()]


VERIFIED = "verified.json"
TIMES = 3  # default number of replays of a failure


@dataclass(frozen=True, kw_only=True)
class Verified:
    """Replays of the first failures of each variant of a run."""

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

        So are violations of the same variant in their phase, except in an episode that was replayed and does repeat.
        """
        if not self.flaky:
            return tuple(records)
        flaky = {variant for each in records if each.index in self.flaky for variant in _variants(each)}
        repeating = self.episodes.keys() - self.flaky
        return tuple(
            record
            if record.index in repeating
            else record.refused(REPEATS, {name for variant, name in _variants(record).items() if variant in flaky})
            for record in records
        )

    def headlined(self, metrics: RunMetrics, judged: Sequence[EpisodeRecord]) -> RunMetrics:
        """Adds the headline of a phase's `judged` episodes to its metrics."""
        repeating = self.episodes.keys() - self.flaky
        first: dict[str, DrivenBy | None] = {}  # of a kind: what drove the episode
        published: dict[str, None] = {}  # kinds
        for episode in judged:
            for violation in episode.valid_violations if episode.index in repeating else ():
                if violation.headline_candidate:
                    first.setdefault(violation.kind, episode.driven_by)
                    if violation.published_preventable:
                        published[violation.kind] = None
        return metrics.model_copy(
            update={
                "headline": len(first),
                "headline_kinds": tuple(first),
                "headline_kinds_published": tuple(published),
                "headline_kinds_driven_by": tuple(first.values()),
            }
        )


def with_headline(results: RunResults, verified: Verified) -> RunResults:
    """Returns the results with each phase's headline failures in its metrics."""
    judged = verified.judged([failure.episode for failure in results.failures])

    def told(metrics: RunMetrics | None, *, evaluating: bool) -> RunMetrics | None:
        episodes = [each for each in judged if each.evaluating is evaluating]
        return None if metrics is None else verified.headlined(metrics, episodes)

    return replace(
        results,
        metrics=told(results.metrics, evaluating=False),
        evaluation=told(results.evaluation, evaluating=True),
    )


def _variants(episode: EpisodeRecord) -> Mapping[tuple[str, str], str]:
    """Returns phase and variant of each valid violation → its requirement."""
    return {(episode.phase, variant_name(each)): each.requirement for each in episode.valid_violations}


def first_of_variants(results: RunResults) -> list[EpisodeRecord]:
    """Selects episodes with the first failure of a variant in their phase.

    It is the first valid, the first preventable, the first that R157, FSM or RSS prevents, or the first candidate for
    the headline. The episodes come in their order.
    """
    seen: set[tuple[str, str, str]] = set()
    episodes = []
    for episode in (failure.episode for failure in results.failures):
        new = {
            (episode.phase, variant_name(violation), step)
            for violation in episode.valid_violations
            for step, passed in (
                ("valid", True),
                ("preventable", violation.preventable),
                ("published", violation.published_preventable),
                ("candidate", violation.headline_candidate),
            )
            if passed
        }
        if not new <= seen:
            episodes.append(episode)
        seen |= new
    return episodes


def read_boundary_map(folder: Path) -> BoundaryMap | None:
    """Reads the map of a `boundary` run; None if absent or damaged."""
    try:
        return BoundaryMap.model_validate_json((folder / BOUNDARY).read_bytes())
    except (FileNotFoundError, ValidationError):
        return None


def read_rates(folder: Path) -> Rates | None:
    """Reads the rates of a `rate` run; None if absent or damaged."""
    try:
        return Rates.model_validate_json((folder / RATES).read_bytes())
    except (FileNotFoundError, ValidationError):
        return None


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
