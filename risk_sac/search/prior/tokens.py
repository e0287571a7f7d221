"""Tokens of a scene: each actor as seen from the ego.

They are of the release, have no names, and need no simulation.

The first entries of a token are the same in a mirror that lies along the ego's way; the last ones change their sign.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError, SceneError
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.lane_places import lane_line, lanes_ahead
from risk_sac.scenario.layout import LEAD_IN_S, BodyStart, Layout, PedestrianStart, StaticStart, VehicleStart
from risk_sac.scenario.limits import Conditions, Limits, conditions, limits_from_odd
from risk_sac.scenario.travel_line import TravelLine, line_of
from risk_sac.search.scripts import PASSIVE, SAME_WAY_COS, SIZE, Genes
from risk_sac.world.net import Net, NetLane
from risk_sac.world.types import Floats, Role

SCENES = 256  # whose tokens are kept
OTHERS = 4  # bodies beside the adversaries, the nearest ones
X_M, Y_M, SPEED_MPS, TIME_S, FAR = 40.0, 8.0, 15.0, 5.0, 5.0  # scales; most of an entry
LATERAL_MPS, TURN_RAD, LANES, LIMIT_MPS2 = 4.0, math.pi / 2, 3.0, 8.0
SAME_POINT_M, TURNS_RAD = 1e-3, 0.5
STATIONS_M = np.arange(0.0, 121.0, 1.5)  # of a way, where it is compared with another
MEETS_M = 2.2  # between two ways
AHEAD_S = (0.0, 2.0, 4.0, 6.0, 8.0)  # times at which a signal's colour is an entry
BENDS_M = (15.0, 30.0, 60.0)  # places of the ego's way whose direction is an entry
GREEN = {"G": 1.0, "g": 0.7, "y": 0.3, "Y": 0.3}
SIGHTS = np.linspace(0.05, 0.95, 24)[:, None]  # shares of a line of sight
ROLES = (Role.ADVERSARY, Role.STORY, Role.BACKGROUND, Role.STATIC)
STEER = Genes._fields.index("steer")
Entries = NDArray[np.float32]


class SceneTokens(NamedTuple):
    """Tokens of one scene; the adversaries come first, in the family's order."""

    scene: Entries  # SCENE_EVEN + SCENE_ODD
    actors: Entries  # n x (ACTOR_EVEN + ACTOR_ODD)
    present: NDArray[np.bool_]  # n
    turns: NDArray[np.bool_]  # n; whether the mirror changes the side of its steering gene


class PlacedActor(NamedTuple):
    """A body at the release, with the way ahead of it."""

    start: BodyStart
    role: Role
    x_m: float  # of its centre
    y_m: float
    heading_rad: float
    speed_mps: float
    way: Floats  # k x 2, from its front on; of a standing body its centre alone
    lanes: tuple[NetLane, ...]  # from the one under its front on; none of a body that moves freely
    letters: tuple[float, ...]  # how green its signal is at `AHEAD_S`; 1 without a signal
    stop_m: float  # to that signal; infinite without one


class TokenBatch(NamedTuple):
    """Tokens of `b` points: each a scene, and a script of each adversary."""

    scene: Entries  # b x scene entries
    actors: Entries  # b x n x actor entries
    scripts: Entries  # b x n x (1 + SIZE): whether it acts, and its genes in [-1, 1]; zeros of what does not
    present: NDArray[np.bool_]  # b x n
    turns: NDArray[np.bool_]  # b x n
    playable: NDArray[np.bool_]  # b; whether the scene can be laid out

    def taken(self, rows: NDArray[np.intp]) -> "TokenBatch":
        """Returns the tokens of some of the points."""
        return TokenBatch(
            scene=self.scene[rows],
            actors=self.actors[rows],
            scripts=self.scripts[rows],
            present=self.present[rows],
            turns=self.turns[rows],
            playable=self.playable[rows],
        )

    def mirrored(self) -> "TokenBatch":
        """Returns the same, seen in a mirror that lies along the ego's way."""
        scene, actors, scripts = self.scene.copy(), self.actors.copy(), self.scripts.copy()
        scene[:, SCENE_EVEN:] *= -1.0
        actors[:, :, ACTOR_EVEN:] *= -1.0
        scripts[:, :, 1 + STEER] *= np.where(self.turns, -1.0, 1.0)
        return self._replace(scene=scene, actors=actors, scripts=scripts)


class Tokenizer:
    """Makes the tokens of a problem's points."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._actors = len(problem.family.adversaries) + OTHERS
        self.genes = SIZE * len(problem.family.adversaries)  # of a point
        self._tokens = lru_cache(maxsize=SCENES)(self._of_key)
        self._nothing = self._none()

    def batch(self, points: Floats) -> TokenBatch:
        """Returns the tokens of points in the unit cube: scenes, and the genes behind them; `b x d`."""
        size = self._problem.space.dimension
        of = [self._tokens(row.tobytes()) for row in np.ascontiguousarray(points[:, :size], dtype=np.float64)]
        scenes = [self._nothing if one is None else one for one in of]
        genes = points[:, size:].reshape(len(points), -1, SIZE)
        scripts = np.zeros((len(points), self._actors, 1 + SIZE), np.float32)
        active = genes[:, :, 0]
        acts = active >= np.minimum(PASSIVE, active.max(axis=1, initial=0.0, keepdims=True))
        scripts[:, : genes.shape[1]] = acts[:, :, None] * np.concatenate([acts[:, :, None], 2.0 * genes - 1.0], axis=2)
        return TokenBatch(
            scene=np.stack([one.scene for one in scenes]),
            actors=np.stack([one.actors for one in scenes]),
            scripts=scripts,
            present=np.stack([one.present for one in scenes]),
            turns=np.stack([one.turns for one in scenes]),
            playable=np.array([one is not None for one in of]),
        )

    def of_scene(self, unit_scene: Floats) -> SceneTokens:
        """Returns the tokens of a scene in the unit cube; zeros if it cannot be laid out."""
        return self._tokens(unit_scene.tobytes()) or self._nothing

    def _of_key(self, key: bytes) -> SceneTokens | None:
        """Returns the tokens of a scene; None if it cannot be laid out."""
        try:
            return self.tokens(np.frombuffer(key))
        except (ConfigError, SceneError):
            return None

    def _none(self) -> SceneTokens:
        actors = np.zeros((self._actors, ACTOR_EVEN + ACTOR_ODD), np.float32)
        nothing = np.zeros(self._actors, np.bool_)
        return SceneTokens(np.zeros(SCENE_EVEN + SCENE_ODD, np.float32), actors, nothing, nothing)

    def tokens(self, unit_scene: Floats) -> SceneTokens:
        """Returns the tokens of a scene in the unit cube.

        Raises:
          ConfigError: the scene cannot be laid out.
          InfeasibleScene: it breaks a rule of C_hard.
        """
        problem = self._problem
        scene = problem.space.from_unit(unit_scene)
        layout = problem.family.layout(scene.values)
        net = net_of(layout.net)
        limits = limits_from_odd(problem.odd, layout.friction)
        lead_s = LEAD_IN_S if layout.story is None else 0.0
        starts: list[VehicleStart | PedestrianStart] = [layout.ego, *layout.vehicles, *layout.pedestrians]
        ego, *others = [placed(net, layout, start, lead_s) for start in starts] + [
            placed(net, layout, static, 0.0) for static in layout.statics
        ]
        by_name = {other.start.id: other for other in others}
        adversaries = [by_name.get(name) for name in problem.family.adversaries]
        rest = [other for other in others if other.start.id not in problem.family.adversaries]
        rest.sort(key=lambda other: math.hypot(other.x_m - ego.x_m, other.y_m - ego.y_m))
        shown: list[PlacedActor | None] = [*adversaries, *rest[:OTHERS]]
        statics = any(isinstance(other.start, StaticStart) for other in others)
        actors = np.zeros((len(adversaries) + OTHERS, ACTOR_EVEN + ACTOR_ODD), np.float32)
        present, turns = np.zeros(len(actors), np.bool_), np.ones(len(actors), np.bool_)
        for i, actor in enumerate(shown):
            if actor is not None:
                actors[i] = _actor(net, ego, actor, others, limits)
                present[i] = True
                same_way = math.cos(actor.heading_rad - ego.heading_rad) > SAME_WAY_COS
                turns[i] = isinstance(actor.start, PedestrianStart) or not same_way or statics
        seen = conditions(problem.odd, scene.values, sensor=problem.ego.sensor is not None)
        return SceneTokens(_scene(net, ego, layout, seen, len(others)), actors, present, turns)


def placed(net: Net, layout: Layout, start: BodyStart, lead_s: float) -> PlacedActor:
    """Places a body where it is at the release if it keeps its speed."""
    if isinstance(start, VehicleStart):
        return _driving(net, layout, start, lead_s)
    free = (1.0,) * len(AHEAD_S)
    if isinstance(start, PedestrianStart):
        cos, sin = math.cos(start.heading_rad), math.sin(start.heading_rad)
        x_m, y_m = start.x_m + cos * lead_s * start.speed_mps, start.y_m + sin * lead_s * start.speed_mps
        line = np.array([[x_m, y_m]]) + STATIONS_M[:, None] * np.array([[cos, sin]])
        role, speed_mps = start.role, start.speed_mps
        return PlacedActor(start, role, x_m, y_m, start.heading_rad, speed_mps, line, (), free, math.inf)
    assert isinstance(start, StaticStart)
    line = np.array([[start.x_m, start.y_m]])
    return PlacedActor(start, Role.STATIC, start.x_m, start.y_m, start.heading_rad, 0.0, line, (), free, math.inf)


def _driving(net: Net, layout: Layout, start: VehicleStart, lead_s: float) -> PlacedActor:
    first = net.lanes[f"{start.route[0]}_{start.lane}"]
    way, lanes = _way(layout.net, first.id, start.route)
    front_m = start.position_m * lane_line(first).length_m / first.length_m + lead_s * start.speed_mps
    front, rear = way.pose(front_m, start.left_m), way.pose(front_m - start.shape.length_m, start.left_m)
    x_m, y_m = (front.x_m + rear.x_m) / 2, (front.y_m + rear.y_m) / 2
    heading_rad = math.atan2(front.y_m - rear.y_m, front.x_m - rear.x_m)
    stations = np.minimum(front_m + STATIONS_M, way.length_m)
    line = np.column_stack([np.interp(stations, way.station_m, column) for column in way.points.T])
    ends_m = np.cumsum([lane_line(lane).length_m for lane in lanes])
    here = min(int(np.searchsorted(ends_m, front_m)), len(lanes) - 1)
    letters, stop_m = (1.0,) * len(AHEAD_S), math.inf
    for i in range(here, len(lanes) - 1):
        if lanes[i].heads:
            letters, stop_m = _letters(net, layout, lanes[i], lanes[i + 1]), max(float(ends_m[i]) - front_m, 0.0)
            break
    ahead = lanes[here:]
    return PlacedActor(start, start.role, x_m, y_m, heading_rad, start.speed_mps, line, ahead, letters, stop_m)


@lru_cache(maxsize=1024)
def _way(file: str, lane: str, route: tuple[str, ...]) -> tuple[TravelLine, tuple[NetLane, ...]]:
    """Returns a route's line from the beginning of a lane, and its lanes."""
    net = net_of(file)
    here = net.lanes[lane]
    lanes = tuple(lanes_ahead(net, here, here.length_m + 2 * float(STATIONS_M[-1]), route))
    points = np.concatenate([lane_line(one).points for one in lanes])
    apart = np.hypot(*np.diff(points, axis=0).T) > SAME_POINT_M
    return line_of(points[np.concatenate(([True], apart))]), lanes


def _letters(net: Net, layout: Layout, lane: NetLane, following: NetLane) -> tuple[float, ...]:
    """State of the signal at a lane's end for a way, at `AHEAD_S`."""
    turn_rad = math.remainder(following.way_out_rad - lane.way_out_rad, math.tau)
    wanted = "l" if turn_rad > TURNS_RAD else "r" if turn_rad < -TURNS_RAD else "s"
    head = next((head for head in lane.heads if head.turn.lower() == wanted), lane.heads[0])
    program = net.programs.get(head.signal)
    if program is None:
        return (1.0,) * len(AHEAD_S)
    offset_s = layout.signal_offset_s if head.signal == layout.signal else 0.0
    return tuple(GREEN.get(program.letters(offset_s + ahead_s)[head.index], 0.0) for ahead_s in AHEAD_S)


def _meeting(ego: PlacedActor, actor: PlacedActor) -> tuple[bool, float, float, float, float]:
    """The first point at which the ego's way comes near an actor's.

    Returns:
      Whether it does; how far the ego and the actor have to go, m; the actor's direction there in the ego's frame.
    """
    apart = np.hypot(*(ego.way[:, None] - actor.way[None]).transpose(2, 0, 1))
    near = apart < MEETS_M + (actor.start.shape.width_m / 2 if len(actor.way) == 1 else 0.0)
    if not near.any():
        return False, float(STATIONS_M[-1]), float(STATIONS_M[-1]), 1.0, 0.0
    i = int(near.any(axis=1).argmax())
    j = int(apart[i].argmin())
    turn = _direction(actor, j) - _direction(ego, i)
    return True, float(STATIONS_M[i]), float(STATIONS_M[j]), math.cos(turn), math.sin(turn)


def _direction(body: PlacedActor, i: int) -> float:
    """Direction of a way at its ith point."""
    if len(body.way) == 1:
        return body.heading_rad
    for a, b in ((i, i + 1), (i - 1, i)):
        if a >= 0 and b < len(body.way) and math.dist(body.way[a], body.way[b]) > SAME_POINT_M:
            return math.atan2(*(body.way[b] - body.way[a])[::-1])
    return body.heading_rad


def _hidden(ego: PlacedActor, actor: PlacedActor, others: Sequence[PlacedActor]) -> bool:
    """Whether a body that conceals stands between the middles of the ego and an actor."""
    here, there = np.array([ego.x_m, ego.y_m]), np.array([actor.x_m, actor.y_m])
    sights = here + SIGHTS * (there - here)
    for other in others:
        shape = other.start.shape
        if other is not actor and shape.conceals:
            dx, dy = sights.T - np.array([[other.x_m], [other.y_m]])
            cos, sin = math.cos(other.heading_rad), math.sin(other.heading_rad)
            inside = (abs(dx * cos + dy * sin) < shape.length_m / 2) & (abs(dy * cos - dx * sin) < shape.width_m / 2)
            if inside.any():
                return True
    return False


def _waits(net: Net, one: PlacedActor, other: PlacedActor) -> bool:
    """Whether a way lets another pass inside a junction, by the net."""
    ahead = set(other.lanes)
    return any(not ahead.isdisjoint(net.waits_for.get(lane.id, ())) for lane in one.lanes)


def _actor(
    net: Net, ego: PlacedActor, actor: PlacedActor, others: Sequence[PlacedActor], odd_limits: Limits
) -> Entries:
    """The entries of an actor: first those that are the same in a mirror."""
    shape, limits = actor.start.shape, odd_limits.of(actor.start.shape)
    freely = isinstance(actor.start, PedestrianStart)
    cos, sin = math.cos(ego.heading_rad), math.sin(ego.heading_rad)
    dx, dy = actor.x_m - ego.x_m, actor.y_m - ego.y_m
    x_m, y_m = dx * cos + dy * sin, dy * cos - dx * sin
    turn = actor.heading_rad - ego.heading_rad
    meets, ego_m, own_m, meeting_cos, meeting_sin = _meeting(ego, actor)
    ego_s, own_s = ego_m / max(ego.speed_mps, 1.0), own_m / max(actor.speed_mps, 0.5)
    same_edge = bool(ego.lanes and actor.lanes and ego.lanes[0].edge == actor.lanes[0].edge)
    lanes_left = actor.lanes[0].index - ego.lanes[0].index if same_edge else 0
    own_turn = math.remainder(_direction(actor, len(actor.way) - 2) - actor.heading_rad, math.tau)
    even = [
        *(float(shape.name == name) for name in BODIES),
        *(float(actor.role is role) for role in ROLES),
        float(freely),
        shape.length_m / Y_M,
        shape.width_m / Y_M,
        x_m / X_M,
        abs(y_m) / Y_M,
        math.cos(turn),
        actor.speed_mps / SPEED_MPS,
        (actor.speed_mps * math.cos(turn) - ego.speed_mps) / SPEED_MPS,
        float(meets),
        ego_m / X_M,
        own_m / X_M,
        ego_s / TIME_S,
        own_s / TIME_S,
        (own_s - ego_s) / TIME_S if meets else 0.0,
        meeting_cos,
        float(same_edge),
        abs(lanes_left) / LANES,
        abs(own_turn) / TURN_RAD,
        *actor.letters,
        actor.stop_m / X_M,
        float(_hidden(ego, actor, others)),
        float(_waits(net, ego, actor)),
        float(_waits(net, actor, ego)),
        (limits.walk_speed_mps if freely else limits.speed_mps) / SPEED_MPS,
        (limits.walk_accel_mps2 if freely else limits.accel_mps2) / LIMIT_MPS2,
        (limits.walk_brake_mps2 if freely else limits.brake_mps2) / LIMIT_MPS2,
        float(isinstance(actor.start, VehicleStart) and actor.start.uses_oncoming),
    ]
    odd = [
        y_m / Y_M,
        math.sin(turn),
        actor.speed_mps * math.sin(turn) / LATERAL_MPS,
        meeting_sin,
        lanes_left / LANES,
        own_turn / TURN_RAD,
    ]
    assert (len(even), len(odd)) == (ACTOR_EVEN, ACTOR_ODD)
    return np.clip([*even, *odd], -FAR, FAR).astype(np.float32)


def _scene(net: Net, ego: PlacedActor, layout: Layout, seen: Conditions, others: int) -> Entries:
    """The entries of the ego and of the rest of the scene."""
    bends = [
        math.remainder(_direction(ego, int(bend_m / STATIONS_M[1])) - ego.heading_rad, math.tau) / TURN_RAD
        for bend_m in BENDS_M
    ]
    lane = ego.lanes[0]
    beside = [net.lanes.get(f"{lane.edge}_{lane.index + step}") for step in (-1, 1)]
    right, left = (float(one is not None and one.drivable) for one in beside)
    even = [
        ego.start.shape.length_m / Y_M,
        ego.speed_mps / SPEED_MPS,
        lane.limit_mps / SPEED_MPS,
        min(layout.set_speed_mps, lane.limit_mps) / SPEED_MPS,
        *(abs(bend) for bend in bends),
        *ego.letters,
        ego.stop_m / X_M,
        left + right,
        lane.width_m / Y_M,
        layout.friction,
        min(seen.visibility_m, 10.0 * X_M) / X_M / FAR,
        min(seen.unlit_m, 10.0 * X_M) / X_M / FAR,
        others / 10.0,
        float(layout.wary),
    ]
    odd = [*bends, left - right]
    assert (len(even), len(odd)) == (SCENE_EVEN, SCENE_ODD)
    return np.clip([*even, *odd], -FAR, FAR).astype(np.float32)


ACTOR_EVEN, ACTOR_ODD = len(BODIES) + len(ROLES) + len(AHEAD_S) + 26, 6
SCENE_EVEN, SCENE_ODD = len(BENDS_M) + len(AHEAD_S) + 12, len(BENDS_M) + 1
