"""Lays reference lines of OpenDRIVE roads along polylines: straight sides, and cubics around the corners."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from risk_sac.failures.export.written import add
from risk_sac.types import Floats

LEAST_ROUND_M = 0.5  # so far before and behind a corner the line bends at least, where its sides are long enough
KNOTS = np.arange(8) / 8  # of a cubic beside a corner
ROOM = 1.2  # of the way that the innermost lane loses at a corner


@dataclass(frozen=True, slots=True)
class Stop:
    """A place on a line, and the line's direction there."""

    place: Floats  # x, y
    direction: Floats  # of unit length


@dataclass(frozen=True, slots=True)
class ReferenceLine:
    """A smooth line through the corners of a polyline."""

    stops: Sequence[Stop]
    stations_m: Floats  # of the stops
    corners_m: Floats  # stations of the polyline's points

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return float(self.stations_m[-1])

    def knots(self) -> tuple[Floats, Floats, Floats]:
        """Returns how a line beside the polyline is seen from this line, which bends around the corners.

        One that is moved by d to the left of the polyline lies (d - shift) stretch to the left of this line.

        Returns:
          Stations, shifts in m and stretches, `k` each; linear in between.
        """
        found = []
        for (start, end), station in zip(pairwise(self.stops), self.stations_m.tolist(), strict=False):
            curve = _cubic(start, end)
            frame = np.array([start.direction, (-start.direction[1], start.direction[0])])
            for p in KNOTS if curve[1:].any() else KNOTS[:1]:
                side = start if p <= 0.5 else end
                place = start.place + np.array((p, p**2, p**3)) @ curve @ frame
                way = np.array((1.0, 2.0 * p, 3.0 * p**2)) @ curve @ frame
                shift_m = (place - side.place) @ (-side.direction[1], side.direction[0])
                reached_m = _length_m(curve * np.array([(p,), (p**2,), (p**3,)]))
                found.append((station + reached_m, shift_m, np.hypot(*way) / (way @ side.direction)))
        stations_m, shift_m, stretch = np.array([*found, (self.length_m, 0.0, 1.0)]).T
        return stations_m, shift_m, stretch

    def write(self, parent: ET.Element) -> None:
        """Adds the line's geometries to a plan view."""
        straight: ET.Element | None = None  # the last geometry, if it is
        for (start, end), (s, after) in zip(pairwise(self.stops), pairwise(self.stations_m.tolist()), strict=True):
            curve = _cubic(start, end)
            if straight is not None and not curve[1:].any():
                straight.set("length", str(float(straight.attrib["length"]) + after - s))
                continue
            heading = float(np.arctan2(start.direction[1], start.direction[0]))
            x, y = start.place.tolist()
            geometry = add(parent, "geometry", s=s, x=x, y=y, hdg=heading, length=after - s)
            straight = None if curve[1:].any() else geometry
            if straight is not None:
                add(geometry, "line")
                continue
            cubic = add(geometry, "paramPoly3", pRange="normalized", aU=0.0, aV=0.0)
            for power, (u, v) in zip("bcd", curve.tolist(), strict=True):
                cubic.attrib |= {f"{power}U": str(u), f"{power}V": str(v)}


def reference_line(
    points: Floats, half_width_m: float, way_in: Floats | None = None, way_out: Floats | None = None
) -> ReferenceLine:
    """Lays a line through the corners of a polyline.

    Args:
      points: `k x 2`, m; no two neighbours are the same.
      half_width_m: of the lanes beside the line.
      way_in: unit direction in which it begins; default: along its first side.
      way_out: unit direction in which it ends; default: along its last side.
    """
    sides = np.diff(points, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    ways = sides / lengths[:, None]
    stops = [Stop(points[0], ways[0] if way_in is None else way_in)]
    if way_in is not None:
        stops.append(Stop(points[0] + ways[0] * min(LEAST_ROUND_M, lengths[0] / 2), ways[0]))
    for corner, (before, after) in enumerate(pairwise(ways), start=1):
        cos = float(np.linalg.norm(before + after)) / 2  # of half the angle
        lost_m = half_width_m * math.sqrt(max(1.0 - cos**2, 0.0)) / max(cos, 1e-3)
        reach_m = min(max(LEAST_ROUND_M, ROOM * lost_m), lengths[corner - 1] / 2, lengths[corner] / 2)
        place = points[corner]
        stops += [Stop(place - before * reach_m, before), Stop(place + after * reach_m, after)]
    if way_out is not None:
        stops.append(Stop(points[-1] - ways[-1] * min(LEAST_ROUND_M, lengths[-1] / 2), ways[-1]))
    stops.append(Stop(points[-1], ways[-1] if way_out is None else way_out))
    apart = [np.hypot(*(after.place - before.place)) > 1e-6 for before, after in pairwise(stops)]
    pieces_m = [_length_m(_cubic(*ends)) * far for ends, far in zip(pairwise(stops), apart, strict=True)]
    stations_m = np.concatenate(([0.0], np.cumsum(pieces_m)))
    first = 1 if way_in is None else 2
    corners_m = stations_m[first : first + 2 * len(points) - 4].reshape(-1, 2).mean(axis=1)
    kept = [0, *(place for place, far in enumerate(apart, start=1) if far)]
    corners_m = np.concatenate(([0.0], corners_m, stations_m[-1:]))
    return ReferenceLine([stops[place] for place in kept], stations_m[kept], corners_m)


def _cubic(start: Stop, end: Stop) -> Floats:
    """Returns Hermite's cubic between two stops, in the frame of the first.

    The coefficients are of p, p² and p³, `3 x 2`.
    """
    cos, sin = start.direction
    frame = np.array([(cos, -sin), (sin, cos)])
    chord, leaves = (end.place - start.place) @ frame, end.direction @ frame
    if abs(chord[1]) + abs(leaves[1]) < 1e-9:
        return np.array([(chord[0], 0.0), (0.0, 0.0), (0.0, 0.0)])
    speed = np.hypot(*chord) / np.cos(np.arctan2(leaves[1], leaves[0]) / 4.0) ** 2  # as on an arc
    into, out = np.array((speed, 0.0)), leaves * speed
    return np.array([into, 3.0 * chord - 2.0 * into - out, into + out - 2.0 * chord])


def _length_m(cubic: Floats) -> float:
    """Length of a cubic, by Gauss-Legendre quadrature."""
    places, weights = np.polynomial.legendre.leggauss(16)
    p = (places + 1.0) / 2.0
    slopes = np.stack((np.ones_like(p), 2.0 * p, 3.0 * p**2), axis=1) @ cubic
    return float(np.linalg.norm(slopes, axis=1) @ weights / 2.0)
