"""Surfaces and signal heads of a net, and failures as SVG thumbnails.

The SVG is written by hand, because a screen shows dozens of them and matplotlib takes a second for each.
"""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Literal, Self

import numpy as np

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.failures.recording import BOX, Recording, on_body
from risk_sac.records import Record
from risk_sac.scenario.bodies import Shape, body_of
from risk_sac.scenario.families import family_named
from risk_sac.world.net import Head, Net, NetLane, Program
from risk_sac.world.read_net import read_net
from risk_sac.world.types import STEP_S, Floats

SurfaceUse = Literal["lane", "sidewalk", "crossing", "junction"]


@dataclass(frozen=True, slots=True)
class Surface:
    """Ground that one drives or walks on: a lane, crossing or junction."""

    use: SurfaceUse
    outline: Floats  # `k x 2`, m, a closed ring without its last point


COLOURS = {"r": "red", "u": "red_yellow", "y": "yellow", "g": "green", "o": "off", "s": "green"}


def colour(letter: str) -> str:
    """Returns the colour of one of SUMO's letters of a signal."""
    return COLOURS.get(letter.lower(), "off")


def boundaries(centre: Floats, width_m: float) -> tuple[Floats, Floats]:
    """Returns a lane's left and right edge, `k x 2` each."""
    return moved(centre, width_m / 2), moved(centre, -width_m / 2)


def moved(centre: Floats, left_m: float) -> Floats:
    """Moves a line, `k x 2`, to the left, mitred at corners."""
    sides = np.diff(centre, axis=0)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    normals = np.column_stack((-sides[:, 1], sides[:, 0]))
    before, after = np.vstack((normals[:1], normals)), np.vstack((normals, normals[-1:]))
    mitre = before + after
    mitre /= (1.0 + (before * after).sum(axis=1, keepdims=True)).clip(min=0.5)
    line: Floats = centre + mitre * left_m
    return line


def ribbon(centre: Floats, width_m: float) -> Floats:
    """Returns a lane's outline, `2k x 2`: left edge, reversed right edge."""
    left, right = boundaries(centre, width_m)
    return np.concatenate((left, right[::-1]))


def roads_of(family: FamilyName, scene: Mapping[str, float]) -> Sequence[Surface]:
    """Returns the surfaces of a scene's net."""
    return shipped_surfaces(family_named(family).layout(scene).net)


@cache  # there are a few nets, and they stay as they are
def shipped_net(name: str) -> Net:
    """Returns a net by its file's name."""
    return read_net(Path(sumo_nets.__path__[0]) / name)


@cache
def shipped_surfaces(name: str) -> Sequence[Surface]:
    """Returns the surfaces of a net by its file's name."""
    return surfaces(shipped_net(name))


def surfaces(net: Net) -> Sequence[Surface]:
    """Returns a net's surfaces, junctions first: lanes are drawn over them.

    Lanes inside junctions overlap each other and are left out: the junction's own outline stands for them. A lane that
    is closed to cars is shown as a sidewalk.
    """
    shown = [
        Surface("junction", np.array(junction.outline))
        for junction in net.junctions.values()
        if junction.outline and junction.type != "dead_end"
    ]
    for lane in net.lanes.values():
        if lane.use != "inside":
            use: SurfaceUse = "sidewalk" if lane.use == "lane" and not lane.drivable else lane.use
            shown.append(Surface(use, ribbon(lane.centre, lane.width_m)))
    return shown


SignalColour = Literal["red", "yellow", "green", "off"]
Changes = Sequence[tuple[float, SignalColour]]
SHOWN_S = 60.0  # more than the longest episode
A_MOMENT_S = 1e-6  # as in `Program.letters`
OPEN = 0.25  # share of the lane's width, from each side, that a green signal's mark covers
LETTERS: Mapping[str, SignalColour] = {"r": "red", "u": "yellow", "y": "yellow", "g": "green", "s": "green"}
LAMPS: Mapping[SignalColour, str] = {"red": "#e5484d", "yellow": "#f5b700", "green": "#30a46c", "off": "#808080"}


@dataclass(frozen=True, slots=True)
class SignalHead:
    """The signal at a lane's end, or at a crossing's end."""

    x_m: float
    y_m: float
    heading_rad: float  # along the lane
    width_m: float
    changes: Changes  # when it begins to show a colour; 0 s is the start of the episode

    def colour(self, time_s: float) -> SignalColour:
        """Returns the colour that a frame at this time shows."""
        begun = bisect_left([at for at, _ in self.changes], time_s - A_MOMENT_S)
        return self.changes[max(begun - 1, 0)][1]

    def marks(self, time_s: float) -> list[Floats]:
        """Returns lines across the lane, `2 x 2` each.

        One closes it; where it is green there is an end on each side.
        """
        across = np.array((-np.sin(self.heading_rad), np.cos(self.heading_rad))) * self.width_m / 2
        ends = ((-1.0, 1.0),) if self.colour(time_s) != "green" else ((-1.0, 2 * OPEN - 1), (1 - 2 * OPEN, 1.0))
        return [np.array((self.x_m, self.y_m)) + np.outer(pair, across) for pair in ends]


def signal_heads(family: FamilyName, scene: Mapping[str, float]) -> Sequence[SignalHead]:
    """Returns the heads of a scene's signals."""
    layout = family_named(family).layout(scene)
    net, heads = shipped_net(layout.net), []
    for lane in net.lanes.values():
        if lane.heads:
            head = min(lane.heads, key=lambda head: (head.turn != "s", head.index))
            offset_s = layout.signal_offset_s if head.signal == layout.signal else 0.0
            changes = _changes(net.programs[head.signal], head, offset_s)
            heads += [SignalHead(*place, lane.width_m, changes) for place in _places(lane)]
    return heads


def _places(lane: NetLane) -> list[tuple[float, float, float]]:
    """Returns poses at a lane's end, or at both ends of crossings."""
    ends = [(lane.centre[-1], lane.centre[-1] - lane.centre[-2])]
    if lane.use == "crossing":
        ends.append((lane.centre[0], lane.centre[0] - lane.centre[1]))
    return [(float(x), float(y), float(np.arctan2(*along[::-1]))) for (x, y), along in ends]


def _changes(program: Program, head: Head, offset_s: float) -> Changes:
    """Returns a link's colour changes from the cycle running at the start."""
    changes: list[tuple[float, SignalColour]] = []
    time_s = -((offset_s - program.offset_s) % program.cycle_s)
    while time_s < SHOWN_S:
        for duration_s, letters in program.phases:
            colour = LETTERS.get(letters[head.index].lower(), "off")
            if not changes or changes[-1][1] != colour:
                changes.append((time_s, colour))
            time_s += duration_s
    return changes


class SurfaceBody(Record):
    """A piece of ground that one drives or walks on."""

    use: SurfaceUse
    outline: list[tuple[float, float]]
    """Its corners, m, on the map that the series is on; the last one is joined to the first."""


class SignalHeadBody(Record):
    """The signal at a lane's end, or at a crossing's end."""

    x_m: float
    y_m: float
    heading_rad: float
    """Along the lane."""
    width_m: float
    changes: list[tuple[float, SignalColour]]
    """When it begins to show a colour, s, by the clock of the series."""


class RoadsBody(Record):
    """The ground of a failure or a network, and its signals."""

    surfaces: list[SurfaceBody]
    """In the order in which they are to be drawn; none where the scene's family had other roads then."""
    signals: list[SignalHeadBody]
    """Of a failure."""

    @classmethod
    def of(cls, surfaces: Sequence[Surface], decimals: int, heads: Sequence[SignalHead] = ()) -> Self:
        """Describes surfaces, their corners rounded to so many decimals, and signals."""
        return cls(
            surfaces=[SurfaceBody(use=each.use, outline=each.outline.round(decimals).tolist()) for each in surfaces],
            signals=[SignalHeadBody.model_validate(asdict(head)) for head in heads],
        )


WIDTH, HEIGHT = 240, 150  # px
VIEW_S = 3.0  # before the violation
MARGIN_M = 5.0
WIDTHS_M = (30.0, 56.0)  # least and greatest of the view
LEAST_RADIUS = 3.5  # px, of a pedestrian
STRIPE_M = 0.6  # of a crossing
SCALES_M = (5, 10)  # lengths of the bar
BAR_PX = 60  # greatest length of the bar
EGO, STRIKER, GREY = "#0072b2", "#d55e00", "#808080"
# Grey that is seen through suits a light and a dark ground.
GROUND = {
    "junction": f'fill="{GREY}" fill-opacity=".22"',
    "lane": f'fill="{GREY}" fill-opacity=".22" stroke="{GREY}" stroke-opacity=".5" stroke-width=".7"',
    "sidewalk": f'fill="{GREY}" fill-opacity=".1"',
}


def thumbnail(recording: Recording, roads: Sequence[Surface], signals: Sequence[SignalHead] = ()) -> str:
    """Returns an SVG with a transparent ground."""
    view, ends = _View(recording), [*zip(recording.involved, (EGO, STRIKER), strict=False)]
    if _shape(recording, ends[-1][0]) == "vehicle":
        ends.reverse()  # a small body lies over a large one
    violated_s = float(recording["released_s"]) + recording.violation.time_s
    others = (actor for actor in range(len(recording.series["ids"])) if actor not in recording.involved)
    shapes = [
        *(shape for surface in roads if view.shows(surface) for shape in _ground(view, surface)),
        *(shape for head in signals for shape in _signal(view, head, violated_s)),
        *(shape for actor in others for shape in _body(view, recording, actor, f'fill="{GREY}" fill-opacity=".6"')),
        *(shape for actor, colour in ends for shape in _actor(view, recording, actor, colour)),
        *_scale_bar(view),
    ]
    size = f'width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join(shapes)}</svg>'


class _View:
    """Visible ground: the end of both paths, in the middle if possible."""

    def __init__(self, recording: Recording) -> None:
        paths = np.concatenate([_path(recording, actor) for actor in recording.involved])
        bodies = np.array([recording.pose(actor, 0.0)[:2] for actor in recording.involved])
        low, high = paths.min(axis=0) - MARGIN_M, paths.max(axis=0) + MARGIN_M
        width_m = np.clip(max(high[0] - low[0], (high[1] - low[1]) * WIDTH / HEIGHT), *WIDTHS_M)
        self.scale = WIDTH / float(width_m)  # px per m
        reach = np.array((WIDTH, HEIGHT)) / self.scale / 2 - MARGIN_M
        self._middle = np.clip((low + high) / 2, bodies.max(axis=0) - reach, bodies.min(axis=0) + reach)

    def __call__(self, points: Floats) -> Floats:
        """Pixels of `k x 2` points on the map."""
        pixels: Floats = (points - self._middle) * (self.scale, -self.scale) + (WIDTH / 2, HEIGHT / 2)
        return pixels

    def shows(self, surface: Surface) -> bool:
        low, high = self(surface.outline).min(axis=0), self(surface.outline).max(axis=0)
        return bool((high > 0).all() and (low < (WIDTH, HEIGHT)).all())


def _path(recording: Recording, actor: int) -> Floats:
    """Returns an actor's last places, `k x 2`, m, without absent frames."""
    places = np.column_stack((recording["x_m"][:, actor], recording["y_m"][:, actor]))
    shown = (recording.time_s >= -VIEW_S) & (recording.time_s < STEP_S)
    return places[shown & np.isfinite(places).all(axis=1)]


def _ground(view: _View, surface: Surface) -> Iterator[str]:
    if surface.use != "crossing":
        yield f'<polygon {GROUND[surface.use]} points="{_text(view(surface.outline))}"/>'
        return
    sides = surface.outline.reshape(2, -1, 2)  # of a ribbon; the second one runs back
    centre, width_m = (sides[0] + sides[1][::-1]) / 2, np.hypot(*(sides[0][0] - sides[1][-1]))
    yield _line(
        view(centre), GREY, width_m * view.scale, f' stroke-opacity=".4" stroke-dasharray="{STRIPE_M * view.scale:.1f}"'
    )


def _signal(view: _View, head: SignalHead, time_s: float) -> Iterator[str]:
    """Draws a bar across the lane, for green with an open middle."""
    for mark in head.marks(time_s):
        yield _line(view(mark), LAMPS[head.colour(time_s)], 2.6, "")


def _scale_bar(view: _View) -> Iterator[str]:
    length_m = max(each for each in SCALES_M if each * view.scale <= BAR_PX)
    left, top = 6.0, HEIGHT - 6.0
    yield _line(np.array([(left, top), (left + length_m * view.scale, top)]), GREY, 1.5, "")
    yield f'<text x="{left}" y="{top - 4}" font-family="sans-serif" font-size="9" fill="{GREY}">{length_m} m</text>'


def _actor(view: _View, recording: Recording, actor: int, colour: str) -> Iterator[str]:
    yield _line(view(_path(recording, actor)), colour, 2.2, ' stroke-opacity=".9" stroke-linejoin="round"')
    yield from _body(view, recording, actor, f'fill="{colour}" stroke="#fff" stroke-width=".8"')


def _body(view: _View, recording: Recording, actor: int, style: str) -> Iterator[str]:
    """Draws a body at the violation, with an arrow head on vehicles."""
    pose, size = recording.pose(actor, 0.0), (recording["length_m"][actor], recording["width_m"][actor])
    if not np.isfinite(pose).all():
        return
    shape = _shape(recording, actor)
    if shape == "person":
        ((left, top),) = view(np.array([pose[:2]]))
        radius = max(max(size) / 2 * view.scale, LEAST_RADIUS)
        yield f'<circle {style} cx="{left:.1f}" cy="{top:.1f}" r="{radius:.1f}"/>'
        return
    yield f'<polygon {style} points="{_text(view(on_body(pose, size, BOX)))}"/>'
    if shape == "block":
        return
    head = _text(view(on_body(pose, size, [(0.2, 0.7), (0.75, 0), (0.2, -0.7)])))
    yield f'<polygon fill="#fff" fill-opacity=".75" points="{head}"/>'


def _shape(recording: Recording, actor: int) -> Shape:
    return body_of(int(recording.series["body"][actor])).shape


def _line(points: Floats, colour: str, width: float, style: str) -> str:
    return f'<polyline fill="none" stroke="{colour}" stroke-width="{width:.1f}"{style} points="{_text(points)}"/>'


def _text(points: Floats) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points.tolist())
