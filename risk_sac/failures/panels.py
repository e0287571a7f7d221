"""What was measured along the way: one panel per kind of measurement, over time counted from the contact."""

from collections.abc import Callable

from matplotlib.axes import Axes

from risk_sac.failures.recording import Recording
from risk_sac.failures.style import (
    CONFLICT_COLOUR,
    EGO_COLOUR,
    OTHER_COLOUR,
    RELEASE_COLOUR,
    SEEN_COLOUR,
    legend,
)
from risk_sac.risk.ttc import TTC_CAP_S


def _speeds(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "speed_mps")
    axis.set_ylabel("speed\nm/s")
    legend(axis)


def _accelerations(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "accel_mps2")
    axis.set_ylabel("acceleration\nm/s²")


def _both(axis: Axes, recording: Recording, name: str) -> None:
    for actor, colour in ((0, EGO_COLOUR), (recording.other, OTHER_COLOUR)):
        label = str(recording.series["ids"][actor])
        axis.plot(recording.time_s, recording[name][:, actor], color=colour, linewidth=1.2, label=label)


def _distance(axis: Axes, recording: Recording) -> None:
    axis.plot(recording.time_s, recording["distance_m"][:, recording.other], color="black", linewidth=1.2)
    axis.set_ylabel("distance\nm")
    axis.set_ylim(bottom=0)


def _ttc(axis: Axes, recording: Recording) -> None:
    axis.plot(recording.time_s, recording["ttc_s"][:, recording.other], color="black", linewidth=1.2)
    axis.set(ylabel="TTC\ns", ylim=(0, TTC_CAP_S * 1.05))


def _robustness(axis: Axes, recording: Recording) -> None:
    for name, values in zip(recording.series["requirements"], recording["robustness"].T, strict=True):
        axis.plot(recording.time_s, values, linewidth=0.9, label=str(name))
    axis.plot(
        recording.time_s, recording["soft_min"], color="black", linestyle="--", linewidth=1.4, label="soft minimum"
    )
    axis.axhline(0, color="0.6", linewidth=0.6)
    axis.set_ylabel("robustness\nscaled")
    legend(axis)


PANELS: tuple[Callable[[Axes, Recording], None], ...] = (_speeds, _accelerations, _distance, _ttc, _robustness)


def mark_instants(axis: Axes, recording: Recording) -> None:
    """The contact, since when the other was in view, where it was hidden before, release and begin of the conflict."""
    axis.axvline(0, color="black", linewidth=0.8, linestyle="--")
    axis.grid(visible=True, linewidth=0.3)
    for start, end in recording.hidden():
        axis.axvspan(start, end, color="0.9", zorder=0)
    first_visible = recording.time_s[-1] - recording.collision.visible_for_s
    _mark(axis, first_visible, "in view", SEEN_COLOUR, row=0)
    _mark(axis, recording.released_s, "release", RELEASE_COLOUR, row=1)
    if recording.conflict_s is not None:
        _mark(axis, recording.conflict_s, "conflict", CONFLICT_COLOUR, row=2)


def _mark(axis: Axes, time_s: float, name: str, colour: str, row: int) -> None:
    """An instant with its name at the top, in a row of its own so that names do not cover each other."""
    axis.axvline(time_s, color=colour, linewidth=1.0, linestyle=":")
    axis.annotate(
        name,
        (time_s, 1),
        (2, -2 - 9 * row),
        xycoords=axis.get_xaxis_transform(),
        textcoords="offset points",
        va="top",
        fontsize=7,
        color=colour,
        annotation_clip=True,
    )
