"""Curves in the plane by arc length, and polynomials along them.

Clothoids, of which lines and arcs are special ones, and cubic curves.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from risk_sac.world.types import Floats

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
TURN_RAD = 1.5  # of one interval of the quadrature, whose error is then below 1e-12 of its length
TABLE_M = 0.05  # of arc length between the entries of a polynomial's table
MOST_ENTRIES = 20_000
MOST_NODES = 1_000_000  # of the quadrature at once


class Begin(NamedTuple):
    """Beginning of a curve: m, m, rad."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True)
class Clothoid:
    """Curve whose curvature changes in proportion to its length.

    x(s) = x0 + ∫ cos θ, y(s) = y0 + ∫ sin θ, θ(u) = θ0 + κ0 u + (κ1 - κ0) u² / (2 L)
    """

    begin: Begin
    curvature_start: float  # 1/m, positive to the left
    curvature_end: float
    length_m: float

    def at(self, s_m: Floats) -> Floats:
        """Returns x, y, heading and curvature at arc lengths, `n x 4`.

        Beyond its ends the shape goes on.
        """
        x_m, y_m, heading_rad = self.begin
        k0, rate = self.curvature_start, (self.curvature_end - self.curvature_start) / max(self.length_m, 1e-9)
        heading = heading_rad + k0 * s_m + rate * s_m**2 / 2
        if rate == 0.0 and k0 == 0.0:
            dx, dy = s_m * math.cos(heading_rad), s_m * math.sin(heading_rad)
        elif rate == 0.0:
            dx, dy = (np.sin(heading) - math.sin(heading_rad)) / k0, (math.cos(heading_rad) - np.cos(heading)) / k0
        else:
            dx, dy = self._integrals(s_m, rate)
        return np.column_stack((x_m + dx, y_m + dy, heading, k0 + rate * s_m))

    def _integrals(self, s_m: Floats, rate: float) -> tuple[Floats, Floats]:
        """Integrates cos θ and sin θ to arc lengths by Gauss's quadrature."""
        k0 = self.curvature_start
        turned = float(np.max(np.abs(s_m) * (abs(k0) + np.abs(rate * s_m)), initial=0.0))
        parts = max(1, math.ceil(turned / TURN_RAD))
        share = (np.arange(parts)[:, None] + (_NODES + 1.0) / 2).ravel() / parts
        weights = np.tile(_WEIGHTS, parts) / (2 * parts)
        dx, dy = np.empty_like(s_m), np.empty_like(s_m)
        block = max(1, MOST_NODES // len(share))
        for begin in range(0, len(s_m), block):
            own = s_m[begin : begin + block]
            u = own[:, None] * share
            theta = self.begin.heading_rad + k0 * u + rate * u**2 / 2
            dx[begin : begin + block] = own * (np.cos(theta) @ weights)
            dy[begin : begin + block] = own * (np.sin(theta) @ weights)
        return dx, dy

    def place(self, s_m: float) -> tuple[float, float, float, float]:
        """Returns what `at` does, at one arc length."""
        x_m, y_m, heading = self.begin
        curvature = self.curvature_start
        if curvature != self.curvature_end:
            return _row(self.at(np.array([s_m])))
        if curvature == 0.0:
            return x_m + s_m * math.cos(heading), y_m + s_m * math.sin(heading), heading, 0.0
        after = heading + curvature * s_m
        dx, dy = math.sin(after) - math.sin(heading), math.cos(heading) - math.cos(after)
        return x_m + dx / curvature, y_m + dy / curvature, after, curvature


def _row(rows: Floats) -> tuple[float, float, float, float]:
    x_m, y_m, heading, curvature = rows[0].tolist()
    return x_m, y_m, heading, curvature


@dataclass(frozen=True)
class CubicCurve:
    """Cubic u(p), v(p) along and across the begin's heading, by arc length.

    The table of arc lengths is scaled to the stated length, so that a rounded length does not move the end.
    """

    begin: Begin
    u: Sequence[float]  # coefficients of p⁰ to p³
    v: Sequence[float]
    p_end: float
    length_m: float

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        """Parameters and the arc lengths up to them."""
        n = min(max(200, math.ceil(self.length_m / TABLE_M)), MOST_ENTRIES)
        p = np.linspace(0.0, self.p_end, n + 1)
        middle = (p[:-1] + p[1:]) / 2
        speeds = [np.hypot(_slope(self.u, at), _slope(self.v, at)) for at in (p[:-1], middle, p[1:])]
        pieces = (speeds[0] + 4 * speeds[1] + speeds[2]) * (self.p_end / n / 6)  # Simpson's rule
        return p, np.concatenate(([0.0], np.cumsum(pieces)))

    def at(self, s_m: Floats) -> Floats:
        """Returns x, y, heading and curvature at arc lengths, `n x 4`.

        Beyond its ends the tangent goes on.
        """
        parameters, lengths = self._table
        scaled = s_m * (lengths[-1] / max(self.length_m, 1e-9))
        p = np.interp(scaled, lengths, parameters)
        du, dv = _slope(self.u, p), _slope(self.v, p)
        size = np.maximum(np.hypot(du, dv), 1e-12)
        beyond = scaled - scaled.clip(0.0, lengths[-1])  # along the tangent
        u = np.polynomial.polynomial.polyval(p, self.u) + beyond * du / size
        v = np.polynomial.polynomial.polyval(p, self.v) + beyond * dv / size
        bend_u, bend_v = 2 * self.u[2] + 6 * self.u[3] * p, 2 * self.v[2] + 6 * self.v[3] * p
        x_m, y_m, heading_rad = self.begin
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        heading = heading_rad + np.arctan2(dv, du)
        curvature = (du * bend_v - dv * bend_u) / size**3
        return np.column_stack((x_m + u * cos - v * sin, y_m + u * sin + v * cos, heading, curvature))

    def place(self, s_m: float) -> tuple[float, float, float, float]:
        """Returns what `at` does, at one arc length."""
        return _row(self.at(np.array([s_m])))


def _slope(coefficients: Sequence[float], p: Floats) -> Floats:
    _, b, c, d = coefficients
    slope: Floats = b + p * (2 * c + p * 3 * d)
    return slope


Curve = Clothoid | CubicCurve


class Cubic(NamedTuple):
    """Polynomial of the distance from where it begins."""

    start_m: float
    a: float
    b: float
    c: float
    d: float

    def value(self, s_m: float) -> float:
        """Its value."""
        u = s_m - self.start_m
        return self.a + u * (self.b + u * (self.c + u * self.d))

    def slope(self, s_m: float) -> float:
        """Its derivative."""
        u = s_m - self.start_m
        return self.b + u * (2 * self.c + u * 3 * self.d)


class Across(NamedTuple):
    """Lateral place on a road: t, m, and its change per metre."""

    t_m: float
    slope: float


def active(cubics: Sequence[Cubic], s_m: float) -> Cubic | None:
    """Returns the polynomial that holds at a place."""
    i = bisect_right(cubics, s_m, key=attrgetter("start_m")) - 1
    return cubics[i] if i >= 0 else None


def value_at(cubics: Sequence[Cubic], s_m: float) -> Across:
    """Returns value and slope at a place, 0 before the first polynomial."""
    cubic = active(cubics, s_m)
    return Across(0.0, 0.0) if cubic is None else Across(cubic.value(s_m), cubic.slope(s_m))
