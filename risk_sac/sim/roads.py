"""Positions of vehicles along their paths, and their lateral room."""

from functools import cache
from itertools import takewhile
from typing import NamedTuple

import libsumo
import numpy as np

from risk_sac.scenario.layout import Layout
from risk_sac.sim.paths import HEADING, STATION, Along, Way, X, Y, leads_on, way_of
from risk_sac.types import Floats

EDGE_M = 0.01  # SUMO refuses a lateral step that ends exactly on the edge of the road
ROUNDED_M = 0.05  # by which a lane's length may differ from that of its line without a word


class Room(NamedTuple):
    """Lateral room up to the edges of the drivable lanes.

    It counts from a vehicle's sides, or from a lane's middle.
    """

    left_m: float
    right_m: float


class Roads:
    """Roads of an episode's vehicles; answers about a net are kept for the next episode on it."""

    def __init__(self) -> None:
        self._net = ""
        self._routes: dict[str, tuple[str, ...]] = {}

    def enter(self, layout: Layout) -> None:
        """Begins an episode."""
        self._routes = {start.id: start.route for start in (layout.ego, *layout.vehicles)}
        if layout.net != self._net:  # another one may use the same names
            self._net = layout.net
            self._way, self._room, self._stretch = cache(way_of), cache(_room), cache(_stretch)

    def along(self, vehicle: str) -> Along:
        """Locates a vehicle on its path."""
        lane = libsumo.vehicle.getLaneID(vehicle)
        return self._along(vehicle, lane, libsumo.vehicle.getLateralLanePosition(vehicle))

    def way(self, vehicle: str, lane: str) -> Way:
        """Returns the way from the start of a lane along a vehicle's route."""
        return self._way(self._routes[vehicle], lane)

    def way_ahead(self, vehicle: str, x_m: float, y_m: float) -> tuple[Floats, Floats]:
        """Points x and y of the way ahead of a vehicle, its centre first."""
        path, station_m, offset_m = self.along(vehicle)
        ahead = path[:, path[STATION] > station_m]
        sin, cos = np.sin(ahead[HEADING]), np.cos(ahead[HEADING])
        x = np.concatenate(([x_m], ahead[X] - offset_m * sin))
        y = np.concatenate(([y_m], ahead[Y] + offset_m * cos))
        return x, y

    def place(self, vehicle: str, offset_m: float, width_m: float) -> tuple[Room, Along]:
        """Returns how far a vehicle may move sideways, and where it is on its path.

        Only lanes that its route continues from count: SUMO halts a vehicle at the end of any other. `offset_m` is that
        of its centre from its lane's, positive to the left.
        """
        lane = libsumo.vehicle.getLaneID(vehicle)
        left_m, right_m = self.room(vehicle, lane)
        spare = -width_m / 2 - EDGE_M
        return Room(left_m + spare - offset_m, right_m + spare + offset_m), self._along(vehicle, lane, offset_m)

    def room(self, vehicle: str, lane: str) -> Room:
        """Returns the room from a lane's middle along a vehicle's route.

        It reaches to the edges of the lanes that lead on along the route.
        """
        return self._room(self._routes[vehicle], lane)

    def _along(self, vehicle: str, lane: str, offset_m: float) -> Along:
        """Locates a vehicle on its path, given its lane."""
        return Along(self.way(vehicle, lane).path, self.station_m(vehicle, lane), offset_m)

    def station_m(self, vehicle: str, lane: str) -> float:
        """Returns how far a vehicle is along its lane, m.

        SUMO counts in lengths of the lane, which are those of its edge; on a bend the outer lanes are drawn longer.
        """
        return float(libsumo.vehicle.getLanePosition(vehicle) * self._stretch(lane))


def _stretch(lane: str) -> float:
    """Length of a lane's line / length of the lane; 1 where they differ by rounding."""
    drawn_m = float(np.hypot(*np.diff(libsumo.lane.getShape(lane), axis=0).T).sum())
    length_m: float = libsumo.lane.getLength(lane)
    return drawn_m / length_m if abs(drawn_m - length_m) > ROUNDED_M else 1.0


def _room(route: tuple[str, ...], lane: str) -> Room:
    """Returns the room from a lane's middle along `route`.

    It reaches to the edges of the lanes beside it that lead on along `route`.
    """
    edge, _, index = lane.rpartition("_")
    widths = [_width_on_route(f"{edge}_{i}", route) for i in range(libsumo.edge.getLaneNumber(edge))]
    own, half_m = int(index), libsumo.lane.getWidth(lane) / 2
    right, left = takewhile(bool, reversed(widths[:own])), takewhile(bool, widths[own + 1 :])
    return Room(sum(left) + half_m, sum(right) + half_m)


def _width_on_route(lane: str, route: tuple[str, ...]) -> float:
    """Returns a lane's width, m; 0 if the route cannot use it.

    Cars may not use it, or it does not lead to the route's next edge.
    """
    return float(libsumo.lane.getWidth(lane)) if leads_on(route, lane) else 0.0
