"""Conjunctions: defects that act only at some moments, or on some of the others."""

import numpy as np

from risk_sac.egos.defects.condition import Condition, Range
from risk_sac.egos.defects.defective import VEHICLE, Defective, in_front, only, turned
from risk_sac.egos.defects.memory import STANDING_MPS
from risk_sac.egos.defects.prediction import SAME_WAY
from risk_sac.egos.driving import PATH_HEADING, STATION
from risk_sac.egos.seam import Command, Ego, EpisodeStart, Perceived
from risk_sac.scenario.bodies import body_like
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.world.geometry import Sight, frame_view, in_sight
from risk_sac.world.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, Bools, X, Y

EVERYWHERE = Sight(reach_m=np.inf, half_view_rad=np.pi, occlusion=True)
TURN_AHEAD_M, TURN_RAD = 10.0, 0.3  # a path that far ahead which deviates by more from the ego's heading is a turn
LEADS_M, LEADS_ASIDE_M = 60.0, 1.5  # a vehicle within these of another's line leads it
OF_OTHERS = {"bodies", "other_mps", "side", "way", "follows", "hidden_s"}  # the rest is of the ego


class Conditional(Defective):
    """Ego with a defect that acts only under a condition."""

    def __init__(self, ego: Ego, defect: type[Defective], value: float, condition: Condition) -> None:
        """Wraps an ego and the defect around it."""
        super().__init__(ego, value)
        self._defect, self._condition = defect(ego, value), condition
        self._of_others = not OF_OTHERS.isdisjoint(condition.model_dump(exclude_defaults=True))

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode of the defect, and with it of the ego."""
        self.vehicle, self._stood, self._acts = episode.vehicle, False, False
        self._seen_s: dict[str, float] = {}
        self._revealed: set[str] = set()
        self._defect.reset(episode)

    def sees(self, p: Perceived) -> Perceived:
        """Takes what the defect makes of the actors that it acts on, and the rest as it is."""
        faulty, which = self._defect.sees(p), self._which(p)
        self._acts = bool(which[0])
        columns = {id_: column for column, id_ in enumerate(faulty.ids)}
        state, keep = p.state.copy(), np.ones(len(p.ids), dtype=np.bool_)
        for i in np.flatnonzero(which[1:]) + 1:
            if (column := columns.get(p.ids[i])) is None:
                keep[i] = False
            else:
                state[:, i] = faulty.state[:, column]
        return only(p._replace(state=state), keep)

    def does(self, command: Command, p: Perceived) -> Command:
        """Takes the defect's command while it acts."""
        faulty = self._defect.does(command, p)
        return faulty if self._acts else command

    def _which(self, p: Perceived) -> Bools:
        """Returns on which of the `n` actors the defect acts; of the ego, whether it acts at all."""
        others = self._others(p) & self._now(p)
        if self._of_others:
            others[0] = others[1:].any()
        return others

    def _now(self, p: Perceived) -> bool:
        """Whether the condition holds of the ego."""
        c, speed = self._condition, float(p.state[SPEED, 0])
        self._stood |= speed < STANDING_MPS
        ahead = max(int(np.searchsorted(p.path[STATION], p.station_m + TURN_AHEAD_M)) - 1, 0)
        turn = p.path[PATH_HEADING, ahead] - p.state[HEADING, 0]
        return (
            _within(speed, c.ego_mps)
            and _within(self.vehicle.grip_mps2 / GRAVITY_MPS2, c.friction)
            and (self._stood or not c.stopped)
            and (not c.turning or abs(np.arctan2(np.sin(turn), np.cos(turn))) > TURN_RAD)
        )

    def _others(self, p: Perceived) -> Bools:
        """Tells of which of the `n` actors the condition holds."""
        c, which = self._condition, np.ones(len(p.ids), dtype=np.bool_)
        if c.bodies:
            which &= [body_like(*size).name in c.bodies for size in p.state[[LENGTH, WIDTH]].T.tolist()]
        if c.other_mps is not None:
            which &= [_within(speed, c.other_mps) for speed in np.hypot(p.state[VX], p.state[VY]).tolist()]
        if c.side is not None:
            which &= (in_front(p)[1] > 0.0) == (c.side == "left")
        if c.way is not None:
            cosine = turned(p)
            way = {"same": cosine > SAME_WAY, "oncoming": cosine < -SAME_WAY, "crossing": np.abs(cosine) <= SAME_WAY}
            which &= way[c.way]
        if c.follows:
            which &= _following(p)
        if c.hidden_s is not None:
            which &= self._hidden(p, c.hidden_s)
        return which

    def _hidden(self, p: Perceived, least_s: float) -> Bools:
        """Tells which actors came into the line of sight after `least_s` out of it."""
        began_s = self._seen_s.setdefault(p.ids[0], p.time_s)
        visible = in_sight(frame_view(p.state), p.kind[1:] == VEHICLE, EVERYWHERE)
        for id_, seen in zip(p.ids[1:], visible, strict=True):
            if seen and p.time_s - self._seen_s.get(id_, began_s) > least_s:
                self._revealed.add(id_)
            if seen:
                self._seen_s[id_] = p.time_s
        return np.array([id_ in self._revealed for id_ in p.ids])


def _within(value: float, bounds: Range | None) -> bool:
    return bounds is None or bounds[0] <= value <= bounds[1]


def _following(p: Perceived) -> Bools:
    """Tells which vehicles have another one than the ego ahead of them on their line."""
    x, y, heading = p.state[X], p.state[Y], p.state[HEADING]
    dx, dy, cos, sin = x - x[:, None], y - y[:, None], np.cos(heading)[:, None], np.sin(heading)[:, None]
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    on_line = (along > 0.0) & (along < LEADS_M) & (np.abs(across) < LEADS_ASIDE_M)
    leads = on_line & (np.cos(heading - heading[:, None]) > SAME_WAY) & (p.kind == VEHICLE)
    following: Bools = leads[:, 1:].any(axis=1) & (p.kind == VEHICLE)
    return following
