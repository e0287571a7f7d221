"""Draws a failure as a small SVG from above.

It shows roads, signals, both paths, and the bodies at the violation.

The SVG is written by hand, because a screen shows dozens of them and matplotlib takes a second for each.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from risk_sac.failures.net import LAMPS, SignalHead, Surface
from risk_sac.failures.recording import BOX, Recording, on_body
from risk_sac.scenario.bodies import Shape, body_of
from risk_sac.world.types import STEP_S, Floats

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
    """Visible piece of ground: the end of both paths, in the middle if all of it fits."""

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
        """Whether any of it can be seen."""
        low, high = self(surface.outline).min(axis=0), self(surface.outline).max(axis=0)
        return bool((high > 0).all() and (low < (WIDTH, HEIGHT)).all())


def _path(recording: Recording, actor: int) -> Floats:
    """Returns an actor's last places, `k x 2`, m, without frames in which it was absent."""
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
    """Draws a bar across the lane; a green one leaves its middle open."""
    for mark in head.marks(time_s):
        yield _line(view(mark), LAMPS[head.colour(time_s)], 2.6, "")


def _scale_bar(view: _View) -> Iterator[str]:
    """Draws a length of a round number of metres at the lower left."""
    length_m = max(each for each in SCALES_M if each * view.scale <= BAR_PX)
    left, top = 6.0, HEIGHT - 6.0
    yield _line(np.array([(left, top), (left + length_m * view.scale, top)]), GREY, 1.5, "")
    yield f'<text x="{left}" y="{top - 4}" font-family="sans-serif" font-size="9" fill="{GREY}">{length_m} m</text>'


def _actor(view: _View, recording: Recording, actor: int, colour: str) -> Iterator[str]:
    yield _line(view(_path(recording, actor)), colour, 2.2, ' stroke-opacity=".9" stroke-linejoin="round"')
    yield from _body(view, recording, actor, f'fill="{colour}" stroke="#fff" stroke-width=".8"')


def _body(view: _View, recording: Recording, actor: int, style: str) -> Iterator[str]:
    """Draws a body at the violation, that of a vehicle with an arrow head to the front."""
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
