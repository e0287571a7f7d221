"""Reads SUMO's frames; converts its front bumpers and compass degrees."""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import libsumo
import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.bodies import CODES
from risk_sac.scenario.layout import Area, Layout
from risk_sac.sim.lookout import near_outsiders
from risk_sac.sim.solid import Walker
from risk_sac.world.jit import compiled
from risk_sac.world.types import (
    ACCEL,
    HEADING,
    LATERAL,
    LENGTH,
    OFFSET,
    SPEED,
    STEP_S,
    VX,
    VY,
    WIDTH,
    Bools,
    Floats,
    Frame,
    Kind,
    Role,
    Signal,
    X,
    Y,
)

SIDEWALK_M = 1.0  # a pedestrian so near a crossing looks at its signal
CROSSING_LANE = re.compile(r":.*_c\d+_\d+")
COLOURS = {
    letter: colour
    for letters, colour in (("rRuU", Signal.RED), ("yY", Signal.YELLOW), ("gG", Signal.GREEN))
    for letter in letters
}
NONE = Signal.NONE  # to look it up in the class takes longer than to read a signal


class PlacedState(NamedTuple):
    """State of a vehicle that SUMO does not drive, in SUMO's terms."""

    front_x_m: float
    front_y_m: float
    angle_deg: float  # 0 = north, clockwise
    speed_mps: float
    lateral_mps: float
    accel_mps2: float
    offset_m: float  # of its middle from its path
    ahead: tuple[str, float] | None  # letter of the signal ahead, and distance to its stop line, m


class Reading(NamedTuple):
    """A frame with its drivers' views.

    Rows are those of the frame: vehicles first, the ego is row 0.
    """

    frame: Frame
    vehicles: tuple[str, ...]
    row: Mapping[str, int]  # of each vehicle
    speed_and_accel: Sequence[tuple[float, float]]  # of each vehicle, m/s and m/s²: also in the frame, but quicker here
    offset_m: Sequence[float]  # of each vehicle from its lane's centre; the same
    drives: Bools  # of all actors of the frame, which are vehicles
    outside: Bools  # which SUMO's models do not know: pedestrians and static bodies
    near: Sequence[bool]  # of all actors, which have one of those nearby


class Reader:
    """Reads the frames of an episode."""

    def __init__(self, layout: Layout, walkers: Collection[str]) -> None:
        """Prepares to read; all vehicles of the layout have been inserted."""
        starts = (layout.ego, *layout.vehicles)
        self._roles = {start.id: start.role for start in starts}
        self._roles |= {start.id: start.role for start in layout.pedestrians}
        self._walkers = tuple(walkers)
        self._statics = layout.statics
        self._roles |= {start.id: Role.STATIC for start in layout.statics}
        self._body = {start.id: start.shape for start in (*starts, *layout.pedestrians, *layout.statics)}
        self._signals = libsumo.trafficlight.getIDList()
        self._walk_signals = [place for signal in self._signals for place in _walk_signals(signal, layout.crossings)]
        self._vehicles = tuple(start.id for start in starts)
        self._describe()
        self._raw = np.full((len(self._ids), 7), np.nan)

    def _describe(self) -> None:
        """Computes what stays the same until a vehicle leaves the net."""
        driving, walking = len(self._vehicles), len(self._walkers)
        self._ids = (*self._vehicles, *self._walkers, *(start.id for start in self._statics))
        bodies = [self._body[id_] for id_ in self._ids]
        stand = [Kind.PEDESTRIAN if body.shape == "person" else Kind.VEHICLE for body in bodies[driving + walking :]]
        self._kind = np.array([Kind.VEHICLE] * driving + [Kind.PEDESTRIAN] * walking + stand, dtype=np.int8)
        self._codes = np.array([CODES[body.name] for body in bodies], dtype=np.int8)
        self._drives = self._kind == int(Kind.VEHICLE)
        self._outside = np.arange(len(self._ids)) >= driving
        self._role = np.array([self._roles[id_] for id_ in self._ids], dtype=np.int8)
        self._row = {id_: row for row, id_ in enumerate(self._vehicles)}
        self._attackers = [(row, v) for row, v in enumerate(self._vehicles) if self._roles[v] is Role.ADVERSARY]
        self._sizes = np.array([(body.length_m, body.width_m) for body in bodies]).T
        self._no_links, self._none_near = np.zeros(len(self._ids), dtype=np.uint8), [False] * len(self._ids)

    def forget(self, gone: Collection[str]) -> None:
        """Leaves out actors that have left."""
        self._raw = self._raw[[id_ not in gone for id_ in self._ids]]
        self._vehicles = tuple(id_ for id_ in self._vehicles if id_ not in gone)
        self._walkers = tuple(id_ for id_ in self._walkers if id_ not in gone)
        self._describe()

    def turn_adversaries(self, ids: Collection[str]) -> None:
        """Notes which actors of a story have been led away from it."""
        if turned := [id_ for id_ in ids if self._roles[id_] is Role.STORY]:
            self._roles |= dict.fromkeys(turned, Role.ADVERSARY)
            self._describe()

    def read(self, walkers: Mapping[str, Walker], moved: Mapping[str, PlacedState]) -> Reading:
        """Reads all actors; `moved` has the states of vehicles driven elsewhere."""
        get_position, get_angle = libsumo.vehicle.getPosition, libsumo.vehicle.getAngle
        get_speed, get_lateral = libsumo.vehicle.getSpeed, libsumo.vehicle.getLateralSpeed
        get_accel = libsumo.vehicle.getAcceleration
        get_offset = libsumo.vehicle.getLateralLanePosition
        raw: list[float] = []  # flat: numpy converts nested sequences at half the speed
        for id_ in self._vehicles:
            if moved and id_ in moved:
                raw += moved[id_][:7]
            else:
                raw += get_position(id_)
                raw += (get_angle(id_), get_speed(id_), get_lateral(id_), get_accel(id_), get_offset(id_))
        speed_and_accel, offsets = [*zip(raw[3::7], raw[5::7], strict=True)], raw[6::7]
        for w in walkers.values():
            raw += (w.x_m, w.y_m, w.heading_rad, w.speed_mps, 0.0, w.accel_mps2, 0.0)
        for start in self._statics:
            raw += (start.x_m, start.y_m, start.heading_rad, 0.0, 0.0, 0.0, 0.0)
        # Much faster than `np.array`, which looks at the type of each number.
        before, self._raw = self._raw, np.fromiter(raw, np.float64, len(raw)).reshape(-1, 7)
        letter, stop_line_m = self._ahead(moved) if self._signals else ("", math.inf)
        frame = Frame(
            time_s=libsumo.simulation.getTime(),
            ids=self._ids,
            kind=self._kind,
            body=self._codes,
            role=self._role,
            state=_state(self._raw, before, self._sizes, len(self._vehicles)),
            signal=COLOURS.get(letter, NONE),
            stop_line_m=stop_line_m,
            link=self._links(letter, walkers, moved) if self._signals else self._no_links,
            teleported=libsumo.simulation.getStartingTeleportIDList(),
        )
        near = self._none_near
        if len(self._ids) > len(self._vehicles):
            near = near_outsiders(frame.state, self._outside).tolist()
        return Reading(frame, self._vehicles, self._row, speed_and_accel, offsets, self._drives, self._outside, near)

    def _ahead(self, moved: Mapping[str, PlacedState]) -> tuple[str, float]:
        """Returns the letter of the ego's signal and the distance to it.

        The distance is to its stop line; "" and inf without a signal.
        """
        if (ego := moved.get(self._vehicles[0])) is not None:
            return ego.ahead or ("", math.inf)
        ahead = libsumo.vehicle.getNextTLS(self._vehicles[0])
        return (ahead[0][3], ahead[0][2]) if ahead else ("", math.inf)

    def _links(self, ego: str, walkers: Mapping[str, Walker], moved: Mapping[str, PlacedState]) -> NDArray[np.uint8]:
        """Reads the signal letters ahead of the ego and of each adversary.

        A pedestrian's letter is that of its crossing.
        """
        links = self._no_links.copy()
        letters = [(0, ego)] if ego else []
        for row, id_ in self._attackers:
            if (placed := moved.get(id_)) is not None:
                letters += [(row, placed.ahead[0])] if placed.ahead else []
            elif ahead := libsumo.vehicle.getNextTLS(id_):
                letters.append((row, ahead[0][3]))
        for row, walker in enumerate(walkers.values(), start=len(self._vehicles)):
            for area, signal, index in self._walk_signals:
                if area.contains(walker.x_m, walker.y_m):
                    letters.append((row, libsumo.trafficlight.getRedYellowGreenState(signal)[index]))
        for row, letter in letters:
            links[row] = ord(letter)
        return links


@compiled
def _state(raw: Floats, before: Floats, bodies: Floats, vehicles: int) -> Floats:
    """The state of a frame.

    Args:
      raw: `n x 7`, of each actor x, y, angle, speed, lateral speed, acceleration, and offset from its lane. SUMO's own
        of vehicles: front bumpers and compass degrees.
      before: the same in the step before, NaN where there was none.
      bodies: `2 x n`, length and width.
      vehicles: how many actors, the first of them, are vehicles.
    """
    n = len(raw)
    state = np.empty((WIDTH + 1, n))
    for i in range(n):
        x, y, heading, speed, half = raw[i, 0], raw[i, 1], raw[i, 2], raw[i, 3], 0.0
        if i < vehicles:
            heading, half = math.radians(90.0 - heading), bodies[0, i] / 2
        cos, sin = math.cos(heading), math.sin(heading)
        state[VX, i], state[VY, i] = speed * cos, speed * sin
        if i < vehicles and not math.isnan(before[i, 0]):
            # The velocity that was driven: SUMO's angle lags behind a lateral move.
            state[VX, i], state[VY, i] = (x - before[i, 0]) / STEP_S, (y - before[i, 1]) / STEP_S
        state[X, i], state[Y, i], state[HEADING, i] = x - half * cos, y - half * sin, heading
        for k, row in enumerate((SPEED, LATERAL, ACCEL, OFFSET)):
            state[row, i] = raw[i, 3 + k]
        state[LENGTH, i], state[WIDTH, i] = bodies[0, i], bodies[1, i]
    return state


def _walk_signals(signal: str, crossings: Sequence[Area]) -> list[tuple[Area, str, int]]:
    """Returns the signal-controlled crossings, with signal and letter index."""
    found = []
    for index, links in enumerate(libsumo.trafficlight.getControlledLinks(signal)):
        for lane in {lane for link in links for lane in link if CROSSING_LANE.fullmatch(lane)}:
            x, y = np.mean(libsumo.lane.getShape(lane), axis=0)
            found += [(area.grown(SIDEWALK_M), signal, index) for area in crossings if area.contains(x, y)]
    return found
