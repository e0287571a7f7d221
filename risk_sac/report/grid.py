"""The standard's verdict on each scene of a scenario played as written.

A scene passes where the ego does not fail. Where it does, the regulation asks more than it may if a competent driver
would not have avoided the contact either: such a scene is out of scope.
"""

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Literal, get_args

from junitparser import Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite

from risk_sac.config import RunSpec, method_of
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import printable
from risk_sac.records import EpisodeRecord, Outcome, Record
from risk_sac.report.runs import read_records
from risk_sac.run_folder.results import EPISODES, RESULTS, RunResults, read_results
from risk_sac.scenario.families import family_named

Standard = Literal["r157", "fsm", "either"]
STANDARDS: tuple[Standard, ...] = get_args(Standard)
RUNS = "runs"  # below a campaign's folder


class StandardVerdict(StrEnum):
    """Verdict of a standard on the ego in a scene."""

    PASS = "pass"  # it does not fail
    FAIL = "fail"  # it does, and the competent driver would not
    OUT_OF_SCOPE = "out_of_scope"  # both do
    REFUSED = "refused"  # the scene cannot be played
    UNJUDGED = "unjudged"  # a rule refuses the violation, or the ego did not answer


class PlayedPoint(Record):
    """A scene, its outcome for the ego, and the standard's verdict."""

    id: str
    """Of the episode."""
    values: Mapping[str, float | str]
    """Parameter → number or word, in the order of the document."""
    outcome: Outcome
    reason: str
    """Why the scene was refused, or which rules refuse its violation."""
    kind: str
    """Of the ego's failure; empty without one."""
    grade: str
    """Of the ego's failure, by all reference drivers; empty without one."""
    r157: bool | None
    """Whether R157's competent driver avoids a contact in this scene; null where nothing was played."""
    fsm: bool | None
    """The same of the fuzzy safety model."""
    verdict: StandardVerdict


class PlayedGrid(Record):
    """The scenes of one run."""

    spec: RunSpec
    standard: Standard
    points: tuple[PlayedPoint, ...]

    @property
    def counts(self) -> Mapping[StandardVerdict, int]:
        """Verdict → number of scenes, of each verdict."""
        counts = Counter(point.verdict for point in self.points)
        return {verdict: counts[verdict] for verdict in StandardVerdict}

    @property
    def ego(self) -> str:
        """The ego in a word or two."""
        return self.spec.ego.name


def played_grids(paths: Sequence[Path], standard: Standard = "r157") -> tuple[PlayedGrid, ...]:
    """Reads scenes of story runs, finished or not, alone or in campaigns.

    Raises:
      ConfigError: there is no such run.
    """
    grids = []
    for path in paths:
        below = sorted(file.parent for file in (path / RUNS).glob(f"*/{RESULTS}"))
        runs = [(folder, read_results(folder)) for folder in below or [path]]
        told = [(folder, results) for folder, results in runs if method_of(results.spec.method).story]
        if not told:
            raise ConfigError("RUN", f"{path}, with {_methods(runs)}", "a run of story-sweep, story-random or story-bo")
        grids += [
            PlayedGrid(
                spec=results.spec,
                standard=standard,
                points=played_points(results.spec, read_records(folder / EPISODES), standard),
            )
            for folder, results in told
        ]
    return tuple(grids)


def _methods(runs: Sequence[tuple[Path, RunResults]]) -> str:
    return ", ".join(dict.fromkeys(results.spec.method for _, results in runs))


def played_points(spec: RunSpec, records: Sequence[EpisodeRecord], standard: Standard) -> tuple[PlayedPoint, ...]:
    """The scenes of a run's episodes, in their order."""
    parameters = family_named(spec.family).parameters
    return tuple(_point(spec, record, parameters, standard) for record in records)


def _point(
    spec: RunSpec, record: EpisodeRecord, parameters: Mapping[str, ScenarioParameter], standard: Standard
) -> PlayedPoint:
    worst = record.worst_violation if record.outcome is Outcome.FAILURE else None
    avoided = record.avoided_by or {}
    return PlayedPoint(
        id=record.id_in(spec.id),
        values=named_values(record.scene, parameters),
        outcome=record.outcome,
        reason=record.reason,
        kind="" if worst is None else worst.kind,
        grade="" if worst is None or worst.graded is None else worst.graded.value,
        r157=avoided.get("r157"),
        fsm=avoided.get("fsm"),
        verdict=verdict_on(record, standard),
    )


def verdict_on(record: EpisodeRecord, standard: Standard) -> StandardVerdict:
    """Returns a standard's verdict on the ego in an episode.

    A failure without contact is always one: no competent driver leaves the road or enters on red.
    """
    if record.outcome is Outcome.REJECTED:
        return StandardVerdict.REFUSED
    if record.outcome is Outcome.SAFE:
        return StandardVerdict.PASS
    if record.outcome is not Outcome.FAILURE:
        return StandardVerdict.UNJUDGED
    avoided = record.avoided_by or {}
    drivers = ("r157", "fsm") if standard == "either" else (standard,)
    contact = record.collision is not None and record.collision.valid
    if not contact or any(avoided.get(driver, False) for driver in drivers):
        return StandardVerdict.FAIL
    return StandardVerdict.OUT_OF_SCOPE


def varied_of(points: Sequence[PlayedPoint]) -> list[str]:
    """Parameters of which the scenes have several values."""
    names = points[0].values if points else ()
    return [name for name in names if len({point.values.get(name) for point in points}) > 1]


def varied_axes(grids: Sequence[PlayedGrid]) -> tuple[str, str]:
    """Returns the first two parameters that vary; raises `ConfigError` for fewer."""
    varied = varied_of([point for grid in grids for point in grid.points])
    if len(varied) < 2:
        raise ConfigError("over", f"{len(varied)} parameters that vary", "two, for a picture")
    return varied[0], varied[1]


def named_values(scene: Mapping[str, float], parameters: Mapping[str, ScenarioParameter]) -> dict[str, float | str]:
    """Parameter → a scene's number or word; rows by their columns' names."""
    values: dict[str, float | str] = {}
    for name, value in scene.items():
        parameter = parameters.get(name)
        part = 0 if parameter is None else min(int(value * parameter.alternatives), parameter.alternatives - 1)
        if parameter is not None and parameter.words:
            values[name] = parameter.words[part]
        elif parameter is not None and parameter.rows:
            values |= parameter.rows[part]
        else:
            values[name] = value
    return values


def grid_csv(grids: Sequence[PlayedGrid]) -> str:
    """Returns CSV: a row per scene, empty where a run lacks parameters."""
    names = dict.fromkeys(name for grid in grids for point in grid.points for name in point.values)
    own = ("outcome", "reason", "kind", "grade", "r157", "fsm", "verdict")
    text = io.StringIO()
    writer = csv.DictWriter(text, ["id", "scenario", "ego", *names, *own], restval="", lineterminator="\n")
    writer.writeheader()
    for grid in grids:
        for point in grid.points:
            judged = {name: getattr(point, name) for name in own}
            row = {"id": point.id, "scenario": grid.spec.family, "ego": grid.ego, **point.values, **judged}
            writer.writerow({name: _cell(value) for name, value in row.items()})
    return text.getvalue()


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.12g}" if isinstance(value, float) else value


SAID = {
    StandardVerdict.OUT_OF_SCOPE: "out of scope: the competent driver does not avoid the contact either",
    StandardVerdict.REFUSED: "refused",
    StandardVerdict.UNJUDGED: "unjudged",
}


def grid_junit(grids: Sequence[PlayedGrid]) -> bytes:
    """Writes a suite for each run and a case for each scene.

    Cases are grouped by the first parameter that varies.
    """
    report = JUnitXml("risk-sac grid")
    for grid in grids:
        suite = TestSuite(printable(f"{grid.spec.family}.{grid.ego}"))
        for name, value in (("run", grid.spec.id), ("ego", grid.ego), ("standard", grid.standard)):
            suite.add_property(name, printable(value))
        varied = varied_of(grid.points)
        suite.add_testcases([_case(grid, point, varied) for point in grid.points])
        report.add_testsuite(suite)
    report.update_statistics()
    content: bytes = report.tostring()
    return content


def _case(grid: PlayedGrid, point: PlayedPoint, varied: Sequence[str]) -> TestCase:
    told = [f"{name}={_text(point.values[name])}" for name in varied]
    group = ".".join([grid.spec.family, grid.ego, *told[:1]])
    case = TestCase(printable(", ".join(told[1:]) or point.id), printable(group))
    case.add_property("episode", point.id)
    for name in ("r157", "fsm"):
        avoids = getattr(point, name)
        if avoids is not None:
            case.add_property(f"avoided by {name}", "yes" if avoids else "no")
    if point.verdict is StandardVerdict.FAIL:
        case.append(Failure(printable(point.kind), point.grade))
    elif point.verdict is not StandardVerdict.PASS:
        said = SAID[point.verdict] + (f": {point.reason}" if point.reason else "")
        case.append(Skipped(printable(said)))
    return case


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
