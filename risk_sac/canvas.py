"""Matplotlib without a window, for one picture at a time: its style is one per process."""

import io
import threading
from collections.abc import Callable
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


def picture(draw: Callable[[], Figure], format_: str, dpi: float, style: dict[Any, Any]) -> bytes:
    """A figure as a file; the same figure gives the same bytes.

    Args:
      draw: makes the figure; in the style, and while nothing else is drawn.
      format_: png | svg | pdf.
      dpi: dots per inch.
      style: matplotlib's settings that differ from its defaults; its types name them one by one.
    """
    file = io.BytesIO()
    with _DRAWING, mpl.rc_context(style | {"svg.hashsalt": "risk-sac"}):
        draw().savefig(file, format=format_, dpi=dpi, metadata=_UNDATED[format_])
    return file.getvalue()
