"""Matplotlib without a window, for one picture at a time: its style is one per process."""

import io
import threading
from collections.abc import Callable, Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

_UNDATED: dict[str, dict[str, Any]] = {
    "svg": {"Date": None},
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Producer": None},
}
_DRAWING = threading.Lock()


def canvas(size_in: tuple[float, float]) -> Figure:
    """An empty figure, width x height in inches."""
    figure = Figure(figsize=size_in, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def picture(draw: Callable[[], Figure], formats: Sequence[str], dpi: float, style: dict[Any, Any]) -> list[bytes]:
    """A figure as a file of each format; the same figure gives the same bytes.

    Args:
      draw: makes the figure; in the style, and while nothing else is drawn.
      formats: png | svg | pdf.
      dpi: dots per inch.
      style: matplotlib's settings that differ from its defaults; its types name them one by one.
    """
    files = []
    with _DRAWING, mpl.rc_context():
        mpl.rcdefaults()  # neither the user's own style nor one that an ego has set
        mpl.rcParams.update(style | {"svg.hashsalt": "risk-sac"})
        figure = draw()
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # it is laid out now; each file would do it again, a little differently
        for format_ in formats:
            file = io.BytesIO()
            figure.savefig(file, format=format_, dpi=dpi, metadata=_UNDATED[format_])
            files.append(file.getvalue())
    return files
