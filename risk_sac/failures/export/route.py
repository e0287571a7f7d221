"""Where the ego was going: what a free ego is asked to do."""

import numpy as np

from risk_sac.failures.export.net import Lane
from risk_sac.failures.export.recorded import Recorded
from risk_sac.types import Floats

BEYOND_M = 60.0  # into the last road, where a free ego has been through what the failure is about


def goal(failure: Recorded) -> tuple[Lane, Floats]:
    """The lane on the ego's last road that its own lane leads to, and a place on it: x, y and heading.

    On the only road of its route, its own lane, and that lane's end.
    """
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
        reached = next(lane for lane in lanes.values() if lane.edge == last and lane.use == "road")
    return reached, _place(reached.centre, np.inf if len(start.route) == 1 else BEYOND_M)


def _place(line: Floats, along_m: float) -> Floats:
    """x, y and heading so far along a line, or at its end."""
    sides = np.diff(line, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    station = np.concatenate(([0.0], np.cumsum(lengths)))
    side = min(int(np.searchsorted(station[1:], along_m)), len(sides) - 1)
    part = min((along_m - station[side]) / lengths[side], 1.0)
    x, y = line[side] + sides[side] * part
    return np.array([x, y, np.arctan2(sides[side, 1], sides[side, 0])])
