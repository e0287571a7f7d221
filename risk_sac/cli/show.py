"""`risk-sac show`: lists and draws a run's failures; flags that choose failures."""

import argparse
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar

from rich.table import Table

from risk_sac.cli.console import (
    EGO,
    OK,
    OUTCOME,
    driven_by_in_words,
    headline,
    in_words,
    narrow_table,
    offences,
    outcome,
    print_answer,
)
from risk_sac.cli.flags import add_limit
from risk_sac.cli.parser import FAILURE_HELP, RESULTS_HELP, Commands, Parser, add_command, add_json_flag
from risk_sac.config import FamilyName, RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.errors import ConfigError
from risk_sac.failures.question import IDLE
from risk_sac.failures.recording import Recording
from risk_sac.host.terminal import notes
from risk_sac.metrics import headline_driven_by
from risk_sac.records import (
    Collision,
    DrivenBy,
    EpisodeId,
    EpisodeRecord,
    Fault,
    Grade,
    Judgement,
    PlausibilityClass,
    RunMetrics,
    Severity,
    Violation,
)
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import RESULTS, RecordedFailure, RunResults, read_results
from risk_sac.scenario.families import density_of
from risk_sac.verdicts.distinct import DistinctFailures

NAME_WIDTH = 20  # of a requirement's name in the list


def add(commands: Commands) -> None:
    """Adds the command."""
    show = add_command(
        commands,
        "show",
        _show,
        "list a run's failures, or draw one, or the one in a bundle",
        more="Without RESULTS, takes the newest run below the current folder; `show 99` draws its failure 99.",
        example="show runs/low --preventable --sort severity",
    )
    show.add_argument("results", type=Path, nargs="?", metavar="RESULTS", help=f"{RESULTS_HELP}; or a bundle, an .npz")
    show.add_argument("failure", nargs="?", metavar="FAILURE", help=FAILURE_HELP)
    add_filter_flags(show)
    picture = show.group("picture of one failure")
    twin = f"draw beside it the same scene without an attack (idle), or with this ego: {EGO}"
    picture.add_argument("--twin", metavar="TWIN", help=twin)
    out = "(default: failures/FAILURE.png beside RESULTS, or BUNDLE.png beside the bundle)"
    picture.add_argument("--out", type=Path, metavar="FILE.png", help=out)
    add_json_flag(show)


def _show(options: argparse.Namespace) -> int:
    given: Path | None = options.results
    named: str | None = options.failure
    if given is not None and named is None and _names_failure(given):
        named = given.name
        given = None
    if given is not None and given.suffix == ".npz":
        if named is not None:
            raise ConfigError("FAILURE", f"{named!r}", "none: a bundle holds one failure")
        return _draw(options, *_bundled(given), given)
    path = given or newest_run(Path.cwd())
    results = read_results(path)
    if named is None:
        _list(options, results)
        return OK
    failure = results.failure(named)
    folder = path if path.is_dir() else path.parent
    series = folder / failure.series
    return _draw(options, results.spec, Recording(failure, read_series(series)), series)


def _bundled(file: Path) -> tuple[RunSpec, Recording]:
    from risk_sac.failures.bundle import read_bundle  # here, because loading the simulator takes a second

    bundle = read_bundle(file)
    manifest = bundle.manifest
    if manifest.episode.worst_violation is None:
        raise ConfigError("RESULTS", f"{file}, in which the ego violates nothing", "the bundle of a failure")
    return manifest.spec, Recording(RecordedFailure.of(manifest.spec.id, manifest.episode), bundle.series)


def _draw(options: argparse.Namespace, spec: RunSpec, recording: Recording, file: Path) -> int:
    """Draws a failure, by default beside the file of its series."""
    from risk_sac.failures.show import draw  # here, because loading matplotlib takes a second

    twin = None
    if options.twin is not None:
        from risk_sac.failures.play import twin_recording

        ego = None if options.twin == IDLE else read_ego(options.twin)
        twin = twin_recording(spec, recording, ego, options.twin)
    stem = file.stem + ("" if options.twin is None else f"-{Path(options.twin).stem}")
    picture = options.out or file.with_name(f"{stem}.png")
    draw(spec.family, recording, picture, twin)
    print_answer(options, _plain(recording.failure) | {"picture": str(picture)}, f"Drawn: {picture}")
    return OK


def _names_failure(path: Path) -> bool:
    """Tells whether a word names a failure of the newest run.

    It does if it is a number or an id, and no file or folder here.
    """
    id_ = path.name
    return path.parent == Path.cwd() and not path.exists() and (id_.isdecimal() or EpisodeId.parse(id_) is not None)


def newest_run(folder: Path) -> Path:
    """Returns the newest run's folder at most three levels below `folder`.

    Raises:
      ConfigError: there is none.
    """
    found = [file for depth in range(4) for file in folder.glob("*/" * depth + RESULTS)]
    if not found:
        raise ConfigError("RESULTS", "nothing", "the folder of a run", f"there is none below {folder}")
    newest = max(found, key=lambda file: file.stat().st_mtime).parent
    notes.print(f"Newest run: {newest}", markup=False, soft_wrap=True)
    return newest


def _list(options: argparse.Namespace, results: RunResults) -> None:
    by_index = {failure.episode.index: failure for failure in results.failures}
    episodes = [failure.episode for failure in results.failures]
    chosen = [by_index[each.index] for each in listed(options, matching(options, episodes), results.spec.family)]
    lines = [
        f"headline failures{where}: {_headline(phase)}{_driven_by(phase)}\n"
        f"episodes driven by: {driven_by_in_words(phase.episodes_driven_by)}"
        for where, phase in (("", results.metrics), (" of the evaluation", results.evaluation))
        if phase is not None
    ]
    refused = sum(not each.valid_violations for each in episodes)
    if refused and not options.raw:
        lines.append(f"refused by a validity rule: {refused} (--raw lists them)")
    table = _table(results.spec.id, chosen) if chosen else "No failures to list."
    print_answer(options, list(map(_plain, chosen)), "\n".join(lines), table)


def _headline(phase: RunMetrics) -> str:
    return headline(phase.headline, phase.headline_candidates, len(phase.headline_kinds_published))


def _driven_by(phase: RunMetrics) -> str:
    """Returns in brackets what drove the headline failures; empty without any."""
    counts = headline_driven_by([phase])
    return f" (driven by: {driven_by_in_words(counts)})" if counts else ""


def _plain(failure: RecordedFailure) -> dict[str, Any]:
    return {"id": failure.id, "series": failure.series} | failure.episode.model_dump()


def _table(run: str, failures: Sequence[RecordedFailure]) -> Table:
    """Returns a run's table of failures by number, titled by its id.

    Fits 80 columns; only the last one wraps.
    """
    table = narrow_table(
        "number,\nphase",
        OUTCOME,
        "other",
        "speed\nof ego,\nother,\nm/s",
        "ego's\nother's\nzone",
        "requirement, or\nconflict; began\nat s, x y m",
        "failed rules,\nor offences",
        title=run,
    )
    for failure in failures:
        episode, violation = failure.episode, failure.episode.worst_violation
        if violation is None:
            continue
        cells = _of_contact(violation) if isinstance(violation, Collision) else _without_contact(violation)
        table.add_row(
            f"{episode.index}\n{episode.phase}",
            outcome(episode, violation),
            violation.other_id or "",
            *cells,
            in_words([episode.reason]) if episode.reason else "\n".join(offences(violation)),
        )
    return table


def _of_contact(collision: Collision) -> tuple[str, ...]:
    return (
        f"{collision.ego_speed_mps:.1f}\n{collision.other_speed_mps:.1f}",
        f"{collision.ego_zone}\n{collision.other_zone}",
        _conflict(collision.judgement),
    )


def _without_contact(violation: Violation) -> tuple[str, ...]:
    """Returns the cells of a violation without contact, without zones."""
    name = textwrap.fill(violation.requirement, NAME_WIDTH)
    return f"{violation.ego_speed_mps:.1f}", "", f"{name}\n{violation.time_s:.1f}"


def _conflict(judgement: Judgement) -> str:
    began = f"{judgement.conflict_s:.1f}, {judgement.conflict_x_m:.0f} {judgement.conflict_y_m:.0f}"
    return f"{judgement.conflict_type.replace('_', ' ')}\n{began}"


E = TypeVar("E", bound=EpisodeRecord)
Worst: TypeAlias = Collision | Violation


class Filter(NamedTuple):
    """A flag that keeps the failures with a value."""

    what: str
    keeps: Callable[[EpisodeRecord, Worst, str], bool]
    choices: Sequence[str] | None = None


def _severity(worst: Worst) -> Severity | None:
    return worst.severity if isinstance(worst, Collision) else None


def _plausibility(worst: Worst) -> PlausibilityClass | None:
    return None if worst.behaviour is None else worst.behaviour.verdict


def _broke(worst: Worst) -> Sequence[str]:
    if isinstance(worst, Violation):
        return worst.broke
    return worst.judgement.broke


FILTERS: Mapping[str, Filter] = {
    "grade": Filter("of this grade", lambda _, worst, wanted: worst.graded == wanted, [*Grade]),
    "plausibility": Filter(
        "as plausible as this", lambda _, worst, wanted: _plausibility(worst) == wanted, [*PlausibilityClass]
    ),
    "severity": Filter("of this severity", lambda _, worst, wanted: _severity(worst) == wanted, [*Severity]),
    "fault": Filter("caused by this party", lambda _, worst, wanted: worst.blamed == wanted, [*Fault]),
    "driven_by": Filter("whose adversaries this drove", lambda each, _, wanted: each.driven_by == wanted, [*DrivenBy]),
    "requirement": Filter(
        "that violate this requirement, such as no_contact", lambda each, _, wanted: wanted in each.failed
    ),
    "broke": Filter(
        "whose striker broke this rule, such as red_light", lambda _, worst, wanted: wanted in _broke(worst)
    ),
    "kind": Filter("of this kind, in the words of the list", lambda _, worst, wanted: worst.kind == wanted),
}


def _gravest(worst: Worst) -> tuple[bool, int, bool, bool]:
    severity = _severity(worst)
    rank = [*Severity].index(severity) if severity else -1
    return not worst.plausible, -rank, not worst.preventable, worst.blamed is not Fault.EGO


WEIGHT = "weight"
SORTS: Mapping[str, Callable[[Worst], Any]] = {"severity": _gravest, "speed": lambda worst: -worst.ego_speed_mps}
SORTED_BY = (
    "found (the order of the search), weight (severity times plausibility, times the scene's density where a "
    "distribution is declared), severity (plausible and worst first) or speed (the fastest ego first)"
)


def add_filter_flags(parser: Parser) -> None:
    """Adds the flags of a list of failures."""
    group = parser.group("choice of failures")
    for name, filter_ in FILTERS.items():
        choices = f": {', '.join(filter_.choices)}" if filter_.choices else ""
        what = f"only those {filter_.what}{choices}"
        flag = f"--{name.replace('_', '-')}"
        group.add_argument(flag, choices=filter_.choices, metavar=name.upper(), help=what)
    group.add_argument(
        "--preventable", dest="grade", action="store_const", const=str(Grade.PREVENTABLE), help="--grade preventable"
    )
    group.add_argument("--distinct", action="store_true", help="only the first of each kind")
    group.add_argument("--raw", action="store_true", help="also those that a validity rule refused")
    orders = ["found", WEIGHT, *SORTS]
    group.add_argument(
        "--sort", choices=orders, metavar="ORDER", default="found", help=f"by {SORTED_BY} (default: found)"
    )
    add_limit(parser)


def wanted(options: argparse.Namespace) -> dict[str, str | None]:
    """Returns the value of each filter; None where it was not given."""
    return {name: getattr(options, name) for name in FILTERS}


def matching(options: argparse.Namespace, failures: Iterable[E]) -> Iterator[E]:
    """Yields the failures that the filters keep."""
    given = {FILTERS[name].keeps: value for name, value in wanted(options).items() if value is not None}
    for failure in failures:
        worst = failure.worst_violation
        if worst is None or not (worst.valid or options.raw):
            continue
        if all(keeps(failure, worst, value) for keeps, value in given.items()):
            yield failure


def listed(options: argparse.Namespace, failures: Iterable[E], family: FamilyName | None = None) -> list[E]:
    """Returns the failures to list; notes if --limit leaves some out.

    Args:
      options: of the command line.
      failures: all of them.
      family: whose declared density weighs them; None: they come in the order of their weight where that is asked for.
    """
    if options.distinct:
        failures = _first_of_each_kind(failures)
    if options.sort == WEIGHT and family is not None:
        density = density_of(family)
        judged = ((-worst.weight(density(each.scene)), each) for each in failures if (worst := each.worst_violation))
        failures = [each for _, each in sorted(judged, key=itemgetter(0))]
    elif options.sort in SORTS:
        order = SORTS[options.sort]
        judged = ((order(worst), each) for each in failures if (worst := each.worst_violation))
        failures = [each for _, each in sorted(judged, key=itemgetter(0))]
    found = list(islice(failures, options.limit + 1))
    if len(found) > options.limit:
        notes.print(f"There are more: --limit is {options.limit}.")
    return found[: options.limit]


def _first_of_each_kind(failures: Iterable[E]) -> Iterator[E]:
    kinds = DistinctFailures()
    return (failure for failure in failures if sum(map(kinds.add, failure.valid_violations)))
