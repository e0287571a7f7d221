"""Decorator of an ego that the defects derive from, and what they do with a perception."""

import numpy as np

from risk_sac.egos.pilot import track
from risk_sac.egos.seam import Command, Control, Ego, EpisodeStart, Perceived, Vehicle
from risk_sac.sim.pilot import Motion
from risk_sac.world.types import HEADING, SPEED, VX, VY, Bools, Floats, Kind, X, Y

VEHICLE, PEDESTRIAN = int(Kind.VEHICLE), int(Kind.PEDESTRIAN)


class Defective:
    """Ego with a defect. Subclasses override `sees` or `does`."""

    episode: EpisodeStart
    vehicle: Vehicle
    step_s: float

    def __init__(self, ego: Ego, value: float) -> None:
        """Wraps an ego; the value is the parameter of the defect."""
        self._ego, self.value = ego, value

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode."""
        self.episode, self.vehicle, self.step_s = episode, episode.vehicle, episode.step_s
        self.begin()
        self._ego.reset(episode)

    def act(self, perceived: Perceived) -> Command:
        """Returns the command of the ego under the defect."""
        return self.does(self._ego.act(self.sees(perceived)), perceived)

    def close(self) -> None:
        """Closes the ego."""
        self._ego.close()

    def begin(self) -> None:
        """Forgets the previous episode."""

    def sees(self, p: Perceived) -> Perceived:
        """Returns what the ego perceives instead."""
        return p

    def does(self, command: Command, p: Perceived) -> Command:
        """Returns what the ego commands instead, given what there was to perceive."""
        return command

    def steps(self, time_s: float) -> int:
        """Returns the number of steps in a time."""
        return round(time_s / self.step_s)

    def control(self, command: Command, p: Perceived) -> Control:
        """Returns a command as acceleration and steering."""
        if isinstance(command, Control):
            return command
        return track(command, Motion(*p.state[[X, Y, HEADING, SPEED], 0].tolist()), self.vehicle)


def only(p: Perceived, keep: Bools) -> Perceived:
    """Returns the perception of some of the actors; the ego stays."""
    keep = keep.copy()
    keep[0] = True
    ids = tuple(id_ for id_, kept in zip(p.ids, keep, strict=True) if kept)
    return p._replace(ids=ids, kind=p.kind[keep], state=np.compress(keep, p.state, axis=1))


def moving(p: Perceived, which: Bools, vx_mps: Floats | float, vy_mps: Floats | float) -> Perceived:
    """Returns the perception with other velocities of some of the others."""
    which = which.copy()
    which[0] = False
    state = p.state.copy()
    state[VX] = np.where(which, vx_mps, state[VX])
    state[VY] = np.where(which, vy_mps, state[VY])
    state[SPEED] = np.where(which, np.hypot(state[VX], state[VY]), state[SPEED])
    return p._replace(state=state)


def in_front(p: Perceived) -> tuple[Floats, Floats]:
    """Returns how far the actors' centres are ahead of the ego's and to its left, m."""
    x, y, heading = p.state[X] - p.state[X, 0], p.state[Y] - p.state[Y, 0], p.state[HEADING, 0]
    return x * np.cos(heading) + y * np.sin(heading), y * np.cos(heading) - x * np.sin(heading)


def turned(p: Perceived) -> Floats:
    """Returns the cosines of the actors' headings against the ego's: 1 the same way, 0 crossing, -1 oncoming."""
    cosines: Floats = np.cos(p.state[HEADING] - p.state[HEADING, 0])
    return cosines
