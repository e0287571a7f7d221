"""Places the labels of a picture so that none covers another, or a body."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from risk_sac.types import Floats

ASIDE: Floats = np.array([(0, 1), (0, -1), (1, 0), (-1, 0)], dtype=np.float64)  # above, below, right, left
GAPS_PT = (3.0, 12.0, 24.0)
CHARACTER = (0.65, 1.3)  # width and height of one, in font sizes
HALO = [withStroke(linewidth=2, foreground="white")]


@dataclass
class Labels:
    """Labels of one view; a box is its lower left and its upper right corner, m."""

    axis: Axes
    low: Floats  # corners of the view, m
    high: Floats
    m_per_pt: float
    _taken: list[tuple[Floats, Floats]] = field(default_factory=list)

    def reserve(self, corners: Floats) -> None:
        """Keeps labels off a body, given its corners, `k x 2`, m."""
        self._taken.append((corners.min(axis=0), corners.max(axis=0)))

    def write(self, text: str, body: Floats, ways: Iterable[Floats], size_pt: float, colour: str) -> None:
        """Writes beside a body, on the first side with room; writes nothing without any, or out of view.

        Args:
          text: one line.
          body: its corners, `k x 2`, m.
          ways: directions from its middle, best first.
          size_pt: of the font.
          colour: of the text.
        """
        half = np.array((len(text), 1.0)) * CHARACTER * size_pt * self.m_per_pt / 2
        middle, reach = (body.min(axis=0) + body.max(axis=0)) / 2, np.ptp(body, axis=0) / 2
        if (middle < self.low).any() or (middle > self.high).any():
            return
        for gap_pt in GAPS_PT:
            for way in ways:
                centre = middle + way * (reach + half + gap_pt * self.m_per_pt)
                box = centre - half, centre + half
                inside = (box[0] > self.low).all() and (box[1] < self.high).all()
                if inside and not any(_overlap(box, other) for other in self._taken):
                    self._taken.append(box)
                    x, y = centre.tolist()
                    style: dict[str, Any] = {
                        "fontsize": size_pt,
                        "color": colour,
                        "ha": "center",
                        "va": "center",
                        "clip_on": True,
                    }
                    self.axis.text(x, y, text, path_effects=HALO, zorder=6, **style)
                    return


def _overlap(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> bool:
    return bool((one[0] < other[1]).all() and (other[0] < one[1]).all())
