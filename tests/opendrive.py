"""Hand-written OpenDRIVE files, and an independent evaluation of their geometry.

Spirals are Fresnel integrals, arcs circles, and cubics are integrated adaptively.
"""

import cmath
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element

from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import fresnel

LINE, ARC, SPIRAL, POLY, PARAM, PARAM_ARC = "line", "arc", "spiral", "poly3", "param", "param_arc"
Shape = tuple[str, float, Sequence[float]]  # kind, length, parameters
Turned = tuple[complex, float]  # point and heading


def shape_at(shape: Shape, begin: Turned, ds: float) -> Turned:
    """Point and heading of a shape after a length."""
    kind, length, parameters = shape
    point, heading = begin
    if kind in (PARAM, PARAM_ARC, POLY):
        u, v = (parameters[:4], parameters[4:]) if kind != POLY else ((0.0, 1.0, 0.0, 0.0), parameters)

        def speed(p: float) -> float:
            return math.hypot(*(w[1] + 2 * w[2] * p + 3 * w[3] * p * p for w in (u, v)))

        p = brentq(lambda p: quad(speed, 0.0, p)[0] - ds, -0.1, 2 * length + 1.0, xtol=1e-12)
        local = complex(*(w[0] + w[1] * p + w[2] * p**2 + w[3] * p**3 for w in (u, v)))
        slope = complex(*(w[1] + 2 * w[2] * p + 3 * w[3] * p**2 for w in (u, v)))
        return point + local * cmath.exp(1j * heading), heading + cmath.phase(slope)
    first, last = {LINE: (0.0, 0.0), ARC: (*parameters, *parameters), SPIRAL: parameters}[kind]
    rate = (last - first) / length
    if rate != 0.0:
        scale, phase = math.sqrt(math.pi / abs(rate)), heading - first**2 / (2 * rate)
        ends = [fresnel((ds + first / rate) / scale), fresnel(first / rate / scale)]
        along, across = ends[0][1] - ends[1][1], ends[0][0] - ends[1][0]
        moved = scale * complex(along, math.copysign(across, rate)) * cmath.exp(1j * phase)
    elif first != 0.0:
        moved = cmath.exp(1j * heading) * (cmath.exp(1j * first * ds) - 1) / (1j * first)
    else:
        moved = cmath.exp(1j * heading) * ds
    return point + moved, heading + first * ds + rate * ds * ds / 2


def lane_at(root: Element, road: str, lane: int, s: float) -> tuple[float, float, float]:
    """Returns x, y and traffic direction of a lane's middle, from XML."""
    element = next(e for e in root.findall("road") if e.get("id") == road)
    geometry = [g for g in element.iter("geometry") if float(g.get("s", 0)) <= s][-1]
    point, heading = shape_at(*_shape(geometry), s - float(geometry.get("s", 0)))
    section = [e for e in element.iter("laneSection") if float(e.get("s", 0)) <= s][-1]
    offset = [o for o in element.iter("laneOffset") if float(o.get("s", 0)) <= s]

    def across(at: float) -> float:
        t = _cubic(offset[-1], at, "s") if offset else 0.0
        for id_ in range(1, abs(lane) + 1):
            one = next(x for x in section.iter("lane") if int(x.get("id", 0)) == math.copysign(id_, lane))
            widths = [w for w in one.iter("width") if float(section.get("s", 0)) + float(w.get("sOffset", 0)) <= at]
            width = _cubic(widths[-1], at - float(section.get("s", 0)), "sOffset") if widths else 0.0
            t += math.copysign(width / (2 if id_ == abs(lane) else 1), lane)
        return t

    def middle(at: float) -> complex:
        here, turned = shape_at(*_shape(geometry), at - float(geometry.get("s", 0)))
        return here + 1j * cmath.exp(1j * turned) * across(at)

    ahead = cmath.phase(middle(s + 1e-5) - middle(s - 1e-5))
    against = (lane > 0) != (element.get("rule") == "LHT")
    place = point + 1j * cmath.exp(1j * heading) * across(s)
    return place.real, place.imag, ahead + (math.pi if against else 0.0)


def _cubic(element: Element, s: float, start: str) -> float:
    ds = s - float(element.get(start, 0))
    return sum(float(element.get(name, 0)) * ds**i for i, name in enumerate("abcd"))


def _shape(geometry: Element) -> tuple[Shape, Turned]:
    begin = complex(float(geometry.get("x", 0)), float(geometry.get("y", 0))), float(geometry.get("hdg", 0))
    (form,) = list(geometry)
    names = {
        "line": "",
        "arc": "curvature",
        "spiral": "curvStart curvEnd",
        "poly3": "a b c d",
        "paramPoly3": "aU bU cU dU aV bV cV dV",
    }
    kind = PARAM if form.tag == "paramPoly3" else form.tag
    parameters = [float(form.get(name, 0)) for name in names[form.tag].split()]
    return (kind, float(geometry.get("length", 0)), parameters), begin


class Lanes(NamedTuple):
    """Lane section: begin, and lanes' widths (a, b, c, d) and links."""

    start: float
    widths: Mapping[int, Sequence[float]]
    links: Mapping[int, tuple[int | None, int | None]] = {}  # predecessor and successor


def road_xml(
    id_: str,
    shapes: Sequence[Shape],
    sections: Sequence[Lanes],
    *,
    begin: Turned = (0j, 0.0),
    links: str = "",
    junction: str = "-1",
    rule: str = "RHT",
    offsets: Sequence[Sequence[float]] = (),
    kind: str = "",
) -> str:
    """Makes a road of shapes; `offsets` rows: s, a, b, c, d."""
    geometry, s, at = "", 0.0, begin
    for shape in shapes:
        geometry += f'<geometry s="{s!r}" x="{at[0].real!r}" y="{at[0].imag!r}" hdg="{at[1]!r}" length="{shape[1]!r}">'
        geometry += f"{_form(shape)}</geometry>"
        s, at = s + shape[1], shape_at(shape, at, shape[1])
    lanes = "".join(f"<laneOffset {_abcd(row[1:])} s='{row[0]!r}'/>" for row in offsets)
    for section in sections:
        sides = {"left": [i for i in section.widths if i > 0], "right": [i for i in section.widths if i < 0]}
        left, right = ("".join(_lane(section, i) for i in sorted(ids, reverse=True)) for ids in sides.values())
        lanes += f"<laneSection s='{section.start!r}'><left>{left}</left><center><lane id='0' type='none'/></center>"
        lanes += f"<right>{right}</right></laneSection>"
    head = f'<road id="{id_}" length="{s!r}" junction="{junction}" rule="{rule}"><link>{links}</link>{kind}'
    return f"{head}<planView>{geometry}</planView><lanes>{lanes}</lanes></road>".replace("<left></left>", "")


def file_xml(*parts: str) -> str:
    """A file of roads and junctions."""
    return f'<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="7"/>{"".join(parts)}</OpenDRIVE>'


def _lane(section: Lanes, id_: int) -> str:
    before, after = section.links.get(id_, (None, None))
    link = f"<predecessor id='{before}'/>" if before is not None else ""
    link += f"<successor id='{after}'/>" if after is not None else ""
    width = f"<width sOffset='0' {_abcd(section.widths[id_])}/>"
    return f"<lane id='{id_}' type='driving' level='false'><link>{link}</link>{width}</lane>"


def _abcd(values: Sequence[float]) -> str:
    return " ".join(f"{name}='{value!r}'" for name, value in zip("abcd", (*values, 0.0, 0.0, 0.0), strict=False))


def _form(shape: Shape) -> str:
    kind, _, parameters = shape
    if kind == ARC:
        return f'<arc curvature="{parameters[0]!r}"/>'
    if kind == SPIRAL:
        return f'<spiral curvStart="{parameters[0]!r}" curvEnd="{parameters[1]!r}"/>'
    if kind == POLY:
        return f"<poly3 {_abcd(parameters)}/>"
    if kind in (PARAM, PARAM_ARC):
        names = [f"{name}{axis}" for axis in "UV" for name in "abcd"]
        values = " ".join(f'{name}="{value!r}"' for name, value in zip(names, parameters, strict=True))
        return f'<paramPoly3 {values} pRange="{"normalized" if kind == PARAM else "arcLength"}"/>'
    return "<line/>"
