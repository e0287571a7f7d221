"""Makes the map of an ego's boundary from a run's records alone."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.config import RunSpec
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.records.rates import BoundaryAxis, BoundaryMap, BoundaryPoint, BoxShare, DriverMap
from risk_sac.run_folder.results import EPISODES, read_results, records_from_lines
from risk_sac.scenario.declared import Slice
from risk_sac.search.level_set import FailureClassifier
from risk_sac.search.scene_optimizer.base import sobol_points
from risk_sac.world.types import Bools, Floats

SIDES = {2: (25, 25), 3: (21, 21, 3), 4: (17, 17, 3, 3)}  # grid of the map, by the number of axes
BOX = 768  # Sobol points over which areas are taken
SAMPLES, SEED = 400, 60
JUDGED = ("r157", "fsm")  # drivers asked of each recorded episode
LEAST = 2  # outcomes of either class for a map


class Drive(NamedTuple):
    """Outcomes of one driver at points of the slice."""

    name: str
    judged: bool
    points: Floats  # n x k, unit
    fails: Bools  # n


class Fitted(NamedTuple):
    """Driver with posterior samples of where it fails in the box."""

    drive: Drive
    classifier: FailureClassifier | None  # None: all outcomes are alike
    samples: Bools  # SAMPLES x BOX


def fails(record: EpisodeRecord, requirement: str = "") -> bool | None:
    """Whether the ego fails in an episode; None where nothing was played.

    A contact fails whether or not a validity rule refuses it: what is beside the point for a search for failures, such
    as a sideswipe, is still no passing.

    Args:
      record: of the episode.
      requirement: the one that counts; by default a contact, and all that count.
    """
    if record.outcome in (Outcome.REJECTED, Outcome.INVALID):
        return None
    if requirement:
        return record.requirements[requirement].robustness < 0.0
    return record.collision is not None or bool(record.violations)


def read_boundary(folder: Path, beside: Mapping[str, Path]) -> BoundaryMap:
    """Makes the map of a run's folder.

    Args:
      folder: of a run of the method `boundary`.
      beside: name → folder of a run of another ego over the same parameters.

    Raises:
      ConfigError: a folder holds no such run.
    """
    spec, records = _read(folder)
    others = {name: _read(other) for name, other in beside.items()}
    for name, (other, _) in others.items():
        for field in ("family", "boundary"):
            if getattr(other, field) != getattr(spec, field):
                raise ConfigError("RUN", f"{beside[name]}, with another {field}", "runs over the same parameters")
    return boundary_map(spec, records, {name: told for name, (_, told) in others.items()})


def _read(folder: Path) -> tuple[RunSpec, list[EpisodeRecord]]:
    spec = read_results(folder).spec
    if spec.boundary is None:
        raise ConfigError("RUN", f"{folder}, a run of {spec.method}", "a run of the method boundary")
    return spec, records_from_lines((folder / EPISODES).read_bytes())


def boundary_map(
    spec: RunSpec, records: Sequence[EpisodeRecord], beside: Mapping[str, Sequence[EpisodeRecord]] | None = None
) -> BoundaryMap:
    """Maps where an ego, competent drivers and other egos fail.

    Args:
      spec: of the run.
      records: of its episodes.
      beside: name → episodes of another ego over the same parameters.
    """
    slice_ = Problem.from_spec(spec).slice_of(spec)
    wanted = slice_.config.requirement
    drives = [_driven("ego", records, slice_, wanted)]
    together = [*records, *itertools.chain.from_iterable((beside or {}).values())]  # their word is of no ego
    drives += [_judged(name, together, slice_) for name in JUDGED]
    drives += [_driven(name, others, slice_, wanted) for name, others in (beside or {}).items()]
    axes = len(slice_.axes)
    box = sobol_points(axes, SEED, count=BOX).numpy()
    fitted = [_fitted(drive, box) for drive in drives if len(drive.fails)]
    ego = next((each for each in fitted if each.drive.name == "ego"), None)
    sides = [np.linspace(0.0, 1.0, side) if side > 3 else (np.arange(side) + 0.5) / side for side in SIDES[axes]]
    grid = np.array(list(itertools.product(*sides)))
    maps = tuple(_map(each, ego, grid) for each in fitted)
    effects = _effects(maps[0] if maps else None, SIDES[axes])
    points = tuple(_point(spec, record, slice_) for record in records)
    return BoundaryMap(
        family=spec.family,
        ego=spec.ego,
        settings=slice_.config,
        axes=tuple(
            BoundaryAxis(
                name=axis.name,
                unit=axis.unit,
                meaning=axis.meaning,
                low=axis.low,
                high=axis.high,
                levels=tuple((axis.low + side * (axis.high - axis.low)).tolist()),
                has_effect=effect,
            )
            for axis, side, effect in zip(slice_.axes, sides, effects, strict=True)
        ),
        fixed=slice_.fixed,
        points=points,
        refused=sum(point.fails is None for point in points),
        maps=maps,
        notes=(*_notes(slice_, points, maps, effects), *_contradicted(fitted)),
    )


def _driven(name: str, records: Sequence[EpisodeRecord], slice_: Slice, requirement: str) -> Drive:
    told = [
        (slice_.units(record.scene), failing)
        for record in records
        if (failing := fails(record, requirement)) is not None
    ]
    return Drive(name, False, *_arrays(told, len(slice_.axes)))


def _judged(name: str, records: Sequence[EpisodeRecord], slice_: Slice) -> Drive:
    told = [
        (slice_.units(record.scene), not record.avoided_by[name])
        for record in records
        if record.avoided_by is not None and name in record.avoided_by
    ]
    return Drive(name, True, *_arrays(told, len(slice_.axes)))


def _arrays(told: Sequence[tuple[Floats, bool]], axes: int) -> tuple[Floats, Bools]:
    points = np.array([point for point, _ in told]).reshape(-1, axes)
    return points, np.array([failing for _, failing in told], dtype=bool)


def _fitted(drive: Drive, box: Floats) -> Fitted:
    failing = int(drive.fails.sum())
    if min(failing, len(drive.fails) - failing) < LEAST:
        return Fitted(drive, None, np.full((SAMPLES, len(box)), 2 * failing > len(drive.fails)))
    classifier = FailureClassifier(drive.points, drive.fails)
    seed = SEED + sum(drive.name.encode())  # the drivers' samples are independent
    return Fitted(drive, classifier, classifier.samples(box, SAMPLES, seed) > 0.0)


def _map(of: Fitted, ego: Fitted | None, grid: Floats) -> DriverMap:
    name, classifier = of.drive.name, of.classifier
    beside = ego is not None and of is not ego
    return DriverMap(
        name=name,
        judged=of.drive.judged,
        episodes=len(of.drive.fails),
        always=bool(of.samples[0, 0]) if classifier is None else None,
        probability=() if classifier is None else _rounded(classifier.probability(grid)),
        deviation=() if classifier is None else _rounded(classifier.latent(grid)[1]),
        fails=_share(of.samples),
        ego_fails_alone=_share(ego.samples & ~of.samples) if beside and ego is not None else None,
    )


def _rounded(values: Floats) -> tuple[float, ...]:
    return tuple(np.round(values, 4).tolist())


def _share(samples: Bools) -> BoxShare:
    """Median and 95 % interval of a box share over posterior samples."""
    low, middle, high = np.quantile(samples.mean(axis=1), (0.025, 0.5, 0.975)).tolist()
    return BoxShare(share=middle, low=low, high=high)


def _effects(ego: DriverMap | None, sides: tuple[int, ...]) -> tuple[bool, ...]:
    """Whether passing or failing changes along each axis anywhere on the grid."""
    if ego is None or not ego.probability:
        return (False,) * len(sides)
    failing = np.array(ego.probability).reshape(sides) > 0.5
    return tuple(bool((failing.any(axis=i) != failing.all(axis=i)).any()) for i in range(len(sides)))


def _point(spec: RunSpec, record: EpisodeRecord, slice_: Slice) -> BoundaryPoint:
    return BoundaryPoint(
        id=record.id_in(spec.id),
        values=tuple(record.scene[axis.name] for axis in slice_.axes),
        fails=fails(record, slice_.config.requirement),
        refused_failure=record.outcome is Outcome.DEGENERATE,
        avoided_by=record.avoided_by or {},
    )


def _contradicted(fitted: Sequence[Fitted]) -> list[str]:
    """Names drivers whose outcomes contradict the map, such as islands of failures."""
    notes = []
    for each in fitted:
        if each.classifier is not None:
            guessed = each.classifier.probability(each.drive.points) > 0.5
            if wrong := int((guessed != each.drive.fails).sum()):
                notes.append(f"{wrong} of {len(guessed)} outcomes of {each.drive.name} are not as its map says.")
    return notes


def _notes(
    slice_: Slice, points: Sequence[BoundaryPoint], maps: Sequence[DriverMap], effects: Sequence[bool]
) -> list[str]:
    played = [point for point in points if point.fails is not None]
    if not maps:
        return ["No scene could be played."]
    ego, notes = maps[0], []
    if ego.always is not None:
        counted = sum(point.fails is True for point in played)
        notes.append(f"The ego fails in {counted} of {len(played)} scenes: there is no boundary in this box.")
    else:
        names = [axis.name for axis, effect in zip(slice_.axes, effects, strict=True) if not effect]
        notes += [f"{name} has no effect on passing or failing here." for name in names]
    if len(played) < len(points):
        notes.append(f"{len(points) - len(played)} scenes could not be played; the map is a guess there.")
    if degenerate := sum(point.refused_failure for point in points):
        notes.append(f"{degenerate} failures are refused by a validity rule, such as sideswipes; they count here.")
    if slice_.config.others == "drawn":
        beyond = ": beyond the boundary more than half of the scenes fail" if ego.always is None else ""
        notes.append(f"The other parameters are drawn{beyond}.")
    return notes
