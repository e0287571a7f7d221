"""Draws roads, signal heads and bodies seen from above with Pillow, one frame at a time.

The ego is blue, the striker orange, every other body grey. A body that the ego does not know of is only outlined.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw

from risk_sac.failures.net import Surface, colour
from risk_sac.failures.recording import BOX, on_body
from risk_sac.maps.net import Net
from risk_sac.world.types import Floats

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
        """Draws the signal heads at the end of each lane; `letters` are SUMO's, by signal."""
        r = 0.35 * self._scale
        for lane in net.lanes.values():
            for place, head in enumerate(lane.heads if lane.use != "crossing" else []):
                ((x, y),) = self._placed(lane.centre[-1:])
                x += 2.4 * r * (place - (len(lane.heads) - 1) / 2)
                fill = LIGHTS[colour(chr(letters[head.signal][head.index]))]
                self._pen.ellipse((x - r, y - r, x + r, y + r), fill=fill)

    def body(
        self, pose: tuple[float, float, float], size_m: tuple[float, float], tone: str, *, walks: bool, known: bool
    ) -> None:
        """Draws a body: a pedestrian as a circle, a vehicle with a light patch to the front."""
        fill = tone if known else None
        if walks:
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
        """Returns the pixels of points on the map."""
        pixels = (points - self._middle) * (self._scale, -self._scale) + (WIDTH * FINE / 2, HEIGHT * FINE / 2)
        return [(float(x), float(y)) for x, y in pixels]
