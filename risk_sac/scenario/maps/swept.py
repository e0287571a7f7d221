"""The ground that a vehicle covers as it drives across a junction.

It lies along the chord from its front to where its rear comes by. Round a bend the chord is shorter than the way, so
its tail swings out; and between the two the chord cuts the corner.
"""

import numpy as np

from risk_sac.scenario.ground import Point
from risk_sac.scenario.maps.net import Link
from risk_sac.types import Floats

SAMPLED_M = 0.5
ALONG = 9  # points on each side of it


def outlines(link: Link, length_m: float, width_m: float) -> Floats:
    """Points on both sides of a vehicle, wherever it is on its way; x and y in rows, m."""
    line = np.array([*link.source.line, *inside(link), *link.target.line])
    station_m = np.concatenate([[0.0], np.hypot(*np.diff(line, axis=0).T).cumsum()])
    stop_m = station_m[len(link.source.line) - 1]
    entry_m = station_m[len(link.source.line) + len(inside(link))]
    front_m = np.arange(stop_m, min(entry_m + length_m, station_m[-1]), SAMPLED_M)

    def at(stations_m: Floats) -> Floats:
        return np.array([np.interp(stations_m, station_m, each) for each in line.T])

    front, rear = at(front_m), at(np.maximum(front_m - length_m, 0.0))
    (dx, dy), chord_m = front - rear, np.hypot(*(front - rear))
    forward, left = np.array([dx, dy]) / chord_m, np.array([-dy, dx]) / chord_m
    middle = front[:, :, None] - forward[:, :, None] * np.linspace(0.0, length_m, ALONG)
    sides = [middle + side * width_m / 2 * left[:, :, None] for side in (1.0, -1.0)]
    return np.concatenate([each.reshape(2, -1) for each in sides], axis=1)


def inside(link: Link) -> list[Point]:
    """Its way between the roads."""
    return [point for lane in link.inside for point in lane.line]
