"""A failure for export: actors, their motion, and the signals by frame."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.failures.bundle import WORLD, Bundle, Manifest, check_world
from risk_sac.failures.recording import Series
from risk_sac.records import Collision, Violation
from risk_sac.scenario.bodies import Body, body_of
from risk_sac.scenario.layout import Layout
from risk_sac.world.net import Net, NetLane
from risk_sac.world.read_net import read_net
from risk_sac.world.types import STEP_S, Floats, Kind, Role

PER_FRAME = ("x_m", "y_m", "heading_rad", "speed_mps", "accel_mps2")
PER_ACTOR = ("kind", "body", "role", "length_m", "width_m")
BEYOND_M = 60.0  # into the last road, where a free ego has been through what the failure is about


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedActor:
    """A road user; arrays have a row per frame until it left."""

    id: str
    body: Body
    pedestrian: bool  # whether it moves anywhere, as pedestrians do
    role: Role
    length_m: float
    width_m: float
    time_s: Floats  # since the first frame
    x_m: Floats  # of the body's centre
    y_m: Floats
    z_m: Floats  # of the ground
    heading_rad: Floats  # without jumps of 2π
    speed_mps: Floats
    accel_mps2: Floats


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """A failure from 1.5 s before the release to contact or horizon."""

    manifest: Manifest
    series: Series
    signal_heads: NDArray[np.uint8]  # of the bundle
    violation: Collision | Violation  # that names it
    problem: Problem
    layout: Layout
    net_file: Path
    net: Net
    actors: tuple[ExportedActor, ...]  # the ego first

    @classmethod
    def of(cls, bundle: Bundle) -> "Recorded":
        """Reads a bundle.

        Raises:
          ConfigError: its net is gone or another, or an array or a violation is missing.
        """
        manifest, series = bundle.manifest, bundle.series
        check_world(manifest)
        _check(manifest, series)
        violation = manifest.episode.worst_violation
        if violation is None:
            raise ConfigError("BUNDLE", f"{manifest.id} keeps every requirement, so that there is no failure in it")
        if violation.other_id not in (None, *map(str, series["ids"])):
            raise ConfigError("BUNDLE", f"{manifest.id} has no actor {violation.other_id!r}, which its failure names")
        problem = Problem.from_spec(manifest.spec)
        layout = problem.family.layout(manifest.episode.scene)
        net_file = Path(str(files(WORLD))) / layout.net
        net = read_net(net_file)
        return cls(
            manifest=manifest,
            series=series,
            signal_heads=bundle.signal_heads,
            violation=violation,
            problem=problem,
            layout=layout,
            net_file=net_file,
            net=net,
            actors=tuple(_actor(series, column, net) for column in range(len(series["ids"]))),
        )

    @property
    def name(self) -> str:
        """Its name, unique beyond its run; also used in file names."""
        return self.manifest.name

    @property
    def ego(self) -> ExportedActor:
        """The vehicle under test."""
        return self.actors[0]

    @property
    def frames(self) -> int:
        """Number of frames, one every 0.1 s."""
        return len(self.series["time_s"])

    @property
    def striker(self) -> int | None:
        """Column of the touched actor, else of the most important; None without."""
        ids = [actor.id for actor in self.actors]
        return None if self.violation.other_id is None else ids.index(self.violation.other_id)

    @property
    def moment(self) -> int:
        """The first frame that shows the violation; for contacts, the last."""
        after_s = self.released_s + self.violation.time_s
        return min(math.ceil(after_s / STEP_S - 1e-6), self.frames - 1)

    @property
    def time_s(self) -> Floats:
        """Time of each frame since the first."""
        return np.arange(self.frames, dtype=np.float64) * STEP_S

    @property
    def released_s(self) -> float:
        """Computes the release of the adversaries, s since the first frame."""
        return float(self.series["released_s"] - self.series["time_s"][0])

    @cached_property
    def heads(self) -> Mapping[str, NDArray[np.uint8]]:
        """SUMO's letters of each signal, `frames x links`.

        Recorded since the release; before it, and where nothing was recorded, from the signal's fixed program.
        """
        letters: dict[str, NDArray[np.uint8]] = {}
        recorded, column = self.signal_heads, 0
        for id_, program in sorted(self.net.programs.items()):
            shown = [program.letters(self.offset_s(id_, frame)) for frame in range(self.frames)]
            rows = np.array([list(text.encode()) for text in shown], dtype=np.uint8)
            if recorded.size:
                mine = recorded[:, column : column + rows.shape[1]]
                rows[len(rows) - len(mine) :] = mine
                column += rows.shape[1]
            letters[id_] = rows
        return letters

    def offset_s(self, signal: str, frame: int) -> float:
        """Computes a signal's position in its program at a frame, s.

        The frame may be one after the last.
        """
        begins_s = self.layout.signal_offset_s if signal == self.layout.signal else 0.0
        return begins_s + float(self.series["time_s"][0]) + frame * STEP_S


def _actor(series: Series, column: int, net: Net) -> ExportedActor:
    last = int(np.flatnonzero(np.isfinite(series["x_m"][:, column]))[-1]) + 1
    per_frame = {name: np.asarray(series[name][:last, column], dtype=np.float64) for name in PER_FRAME}
    per_frame["heading_rad"] = np.unwrap(per_frame["heading_rad"])
    return ExportedActor(
        id=str(series["ids"][column]),
        body=body_of(int(series["body"][column])),
        pedestrian=bool(series["kind"][column] == Kind.PEDESTRIAN),
        role=Role(int(series["role"][column])),
        length_m=float(series["length_m"][column]),
        width_m=float(series["width_m"][column]),
        time_s=np.arange(last, dtype=np.float64) * STEP_S,
        z_m=net.heights_m(np.column_stack((per_frame["x_m"], per_frame["y_m"]))),
        **per_frame,
    )


def _check(manifest: Manifest, series: Series) -> None:
    frames, actors = len(series["time_s"]), len(np.atleast_1d(series.get("ids", np.empty(0))))
    wanted = dict.fromkeys((*PER_FRAME, "visible"), (frames, actors)) | dict.fromkeys(PER_ACTOR, (actors,))
    for name, shape in wanted.items():
        if name not in series or series[name].shape != shape or series[name].dtype.kind not in "fi":
            raise ConfigError("BUNDLE", f"{manifest.id} has no sound array {name}, so that nothing can be told of it")
    there = np.isfinite(series["x_m"])
    if not actors or not there[0].all() or (there[1:] > there[:-1]).any():
        raise ConfigError("BUNDLE", f"{manifest.id} does not begin with everybody in place")


def goal(failure: Recorded) -> tuple[NetLane, Floats]:
    """Returns a free ego's goal: lane, and pose on its last road."""
    start = failure.layout.ego
    lanes, last = failure.net.lanes, start.route[-1]
    reached, ahead = None, [lanes[f"{start.route[0]}_{start.lane}"]]
    known = {ahead[0].id}
    while ahead and reached is None:
        lane = ahead.pop(0)
        if lane.edge == last:
            reached = lane
        for name in lane.next:
            if name in lanes and name not in known and (lanes[name].edge in start.route or lanes[name].use == "inside"):
                known.add(name)
                ahead.append(lanes[name])
    if reached is None:  # its route asks for another lane than the one that it starts in
        reached = next(lane for lane in lanes.values() if lane.edge == last and lane.use == "lane")
    return reached, _place(reached.centre, np.inf if len(start.route) == 1 else BEYOND_M)


def _place(line: Floats, along_m: float) -> Floats:
    """Returns the pose `along_m` along a line, at most at its end."""
    sides = np.diff(line, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    station = np.concatenate(([0.0], np.cumsum(lengths)))
    side = min(int(np.searchsorted(station[1:], along_m)), len(sides) - 1)
    part = min((along_m - station[side]) / lengths[side], 1.0)
    x, y = line[side] + sides[side] * part
    return np.array([x, y, np.arctan2(sides[side, 1], sides[side, 0])])


def cycle(failure: Recorded, signal: str) -> list[tuple[int, str]]:
    """Returns steps and letters of a signal's phases from the first frame.

    These are of its program, or of the recording where that differs.
    """
    shown = [bytes(row).decode() for row in failure.heads[signal]]
    program = failure.net.programs[signal]
    steps = round(program.cycle_s / STEP_S)
    turning = [program.letters(failure.offset_s(signal, frame)) for frame in range(max(steps, len(shown)))]
    letters = turning[:steps] if turning[: len(shown)] == shown else shown
    return [(len(list(run)), each) for each, run in groupby(letters)]
