"""Draws a GIF of the last seconds, seen from above.

The ego is blue, the striker orange, every other body grey; a body that the ego does not know of is only outlined. The
striker is what the ego touched, or else the actor that mattered most.
"""

import io
from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageColor, ImageDraw, ImageFont

from risk_sac.failures.export.formats import Files
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.net import Surface, colour, surfaces
from risk_sac.failures.recording import BOX, on_body
from risk_sac.failures.sentence import story
from risk_sac.records import Collision
from risk_sac.world.net import Net
from risk_sac.world.types import STEP_S, Floats

WIDTH, HEIGHT, FINE = 560, 340, 2  # px; drawn larger by `FINE`, and then made smooth
VIEW_M = 56.0  # that the width shows
GROUND = {"junction": "#dcdcdc", "lane": "#dcdcdc", "sidewalk": "#efefef", "crossing": "#c8c8c8"}
PAPER, EDGE, INK = "#f8f8f6", "#bdbdbd", "#202020"
EGO, STRIKER, OTHER = "#0072b2", "#d55e00", "#8a8a8a"
LIGHTS = {"red": "#d00000", "red_yellow": "#e07000", "yellow": "#e0b000", "green": "#109010", "off": "#606060"}


class Canvas:
    """Picture of the ground around a place, `middle`, m."""

    def __init__(self, middle: Floats) -> None:
        self._picture = Image.new("RGB", (WIDTH * FINE, HEIGHT * FINE), PAPER)
        self._pen = ImageDraw.Draw(self._picture)
        self._scale = WIDTH * FINE / VIEW_M
        self._middle = middle

    def ground(self, surfaces: Sequence[Surface]) -> None:
        """Draws the roads."""
        for surface in surfaces:
            self._pen.polygon(self._placed(surface.outline), fill=GROUND[surface.use], outline=EDGE)

    def heads(self, net: Net, letters: Mapping[str, bytes]) -> None:
        """Draws signal heads at lanes' ends; `letters` are SUMO's, by signal."""
        r = 0.35 * self._scale
        for lane in net.lanes.values():
            for place, head in enumerate(lane.heads if lane.use != "crossing" else []):
                ((x, y),) = self._placed(lane.centre[-1:])
                x += 2.4 * r * (place - (len(lane.heads) - 1) / 2)
                fill = LIGHTS[colour(chr(letters[head.signal][head.index]))]
                self._pen.ellipse((x - r, y - r, x + r, y + r), fill=fill)

    def body(
        self, pose: tuple[float, float, float], size_m: tuple[float, float], tone: str, *, person: bool, known: bool
    ) -> None:
        """Draws a person as circle, a vehicle with a light front patch."""
        fill = tone if known else None
        if person:
            ring = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
            circle = pose[:2] + 0.45 * np.column_stack((np.cos(ring), np.sin(ring)))
            self._pen.polygon(self._placed(circle), fill=fill, outline=tone, width=3)
            return
        self._pen.polygon(self._placed(on_body(pose, size_m, BOX)), fill=fill, outline=tone, width=3)
        patch = on_body(pose, size_m, [(0.25, 0.7), (0.75, 0), (0.25, -0.7)])
        self._pen.polygon(self._placed(patch), fill="#ffffff" if known else tone)

    def picture(self) -> Image.Image:
        """Returns the picture, `HEIGHT x WIDTH` pixels."""
        return self._picture.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)

    def _placed(self, points: Floats) -> list[tuple[float, float]]:
        pixels = (points - self._middle) * (self._scale, -self._scale) + (WIDTH * FINE / 2, HEIGHT * FINE / 2)
        return [(float(x), float(y)) for x, y in pixels]


LAST_S, AFTER_S, HOLD_MS = 7.0, 2.0, 2000  # before the violation and after it, and how long it stays
EASE = 0.06  # share of the way to the ego that the view moves per picture, so that it does not tremble


def files(failure: Recorded) -> Files:
    """One file."""
    first = max(failure.moment + 1 - round(LAST_S / STEP_S), 0)
    last = min(failure.moment + round(AFTER_S / STEP_S), failure.frames - 1)
    ground = surfaces(failure.net)
    middles = _middles(failure, first, last)
    pictures = [_picture(failure, ground, frame, middle) for frame, middle in enumerate(middles, start=first)]
    palette = _palette()
    flat = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    step_ms = round(STEP_S * 1000)
    lasts_ms = [step_ms] * len(flat)
    lasts_ms[failure.moment - first] = HOLD_MS
    comment = f"{failure.name}: {story(failure.series, failure.violation)}"
    content = io.BytesIO()
    flat[0].save(
        content,
        "GIF",
        save_all=True,
        append_images=flat[1:],
        duration=lasts_ms,
        loop=0,
        comment=comment.replace("²", "2").encode("ascii", "replace"),
    )
    return {f"{failure.name}.gif": content.getvalue()}


def _palette() -> Image.Image:
    """Returns all colours and mixtures: a palette by frequency loses small bodies."""
    tones = np.array(
        [ImageColor.getrgb(tone) for tone in (EGO, STRIKER, OTHER, INK, "#ffffff", EDGE, *LIGHTS.values())]
    )
    grounds = np.array([ImageColor.getrgb(tone) for tone in (PAPER, *sorted(set(GROUND.values())))])
    shares = np.array([0.0, 0.35, 0.7]).reshape(-1, 1, 1, 1)
    mixed = tones[:, None] * (1.0 - shares) + grounds * shares
    colours = np.unique(np.concatenate((grounds, np.rint(mixed).astype(int).reshape(-1, 3))), axis=0)
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.astype(np.uint8).tobytes())
    return palette


def _middles(failure: Recorded, first: int, last: int) -> list[Floats]:
    """Returns each picture's middle, which follows the ego and ends at it."""
    path = np.column_stack((failure.ego.x_m, failure.ego.y_m))[: last + 1]
    middle = path[-1]
    middles: list[Floats] = []
    reach = np.array((WIDTH, HEIGHT)) / WIDTH * VIEW_M / 4  # the ego stays within the middle half
    for place in path[: first - 1 if first else None : -1]:
        middle = np.clip(middle + EASE * (place - middle), place - reach, place + reach)
        middles.append(middle)
    return middles[::-1]


def _picture(failure: Recorded, ground: Sequence[Surface], frame: int, middle: Floats) -> Image.Image:
    canvas = Canvas(middle)
    canvas.ground(ground)
    canvas.heads(failure.net, {name: rows[frame].tobytes() for name, rows in failure.heads.items()})
    for column, actor in sorted(enumerate(failure.actors), key=lambda each: -each[0]):
        if frame < len(actor.time_s):
            canvas.body(
                (actor.x_m[frame], actor.y_m[frame], actor.heading_rad[frame]),
                (actor.length_m, actor.width_m),
                EGO if column == 0 else STRIKER if column == failure.striker else OTHER,
                person=actor.body.shape == "person",
                known=column == 0 or failure.series["visible"][frame, column] == 1,
            )
    picture = canvas.picture()
    _caption(ImageDraw.Draw(picture), failure, frame)
    return picture


def _caption(pen: ImageDraw.ImageDraw, failure: Recorded, frame: int) -> None:
    left_s = (failure.moment - frame) * STEP_S
    what = when = "contact" if isinstance(failure.violation, Collision) else "violation"
    if frame != failure.moment:
        when = f"{abs(left_s):.1f} s {'before' if left_s > 0 else 'after'} the {what}"
    line = f"{when}   ego {failure.ego.speed_mps[frame]:.1f} m/s"
    if not isinstance(failure.violation, Collision):
        pen.rectangle((0, 0, WIDTH, 20), fill=PAPER)
        pen.text((8, 3), f"violates {failure.violation.requirement}", fill=INK, font=ImageFont.load_default(13))
    pen.rectangle((0, HEIGHT - 22, WIDTH, HEIGHT), fill=PAPER)
    pen.text((8, HEIGHT - 19), line, fill=INK, font=ImageFont.load_default(13))
    pen.text((WIDTH - 8, HEIGHT - 17), failure.name, fill=OTHER, font=ImageFont.load_default(10), anchor="ra")
