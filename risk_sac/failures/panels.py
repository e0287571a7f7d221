"""What was measured along the way: one panel per kind of measurement, over time counted from the contact."""

from collections.abc import Callable, Iterator

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from risk_sac.failures.recording import Recording
from risk_sac.failures.style import (
    CONFLICT_COLOUR,
    EGO_COLOUR,
    HIDDEN_COLOUR,
    OTHER_COLOUR,
    RELEASE_COLOUR,
    SEEN_COLOUR,
    legend,
)
from risk_sac.risk.ttc import TTC_CAP_S


def _speeds(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "speed_mps")
    axis.set_ylabel("speed\nm/s")
    if any(True for _ in recording.hidden()):
        axis.add_patch(Rectangle((0, 0), 0, 0, color=HIDDEN_COLOUR, label="hidden from the ego"))
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
    axis.set(ylabel=f"time to\ncollision, s\n({TTC_CAP_S:g}: none)", ylim=(0, TTC_CAP_S * 1.05))


def _robustness(axis: Axes, recording: Recording) -> None:
    for name, values in zip(recording.series["requirements"], recording["robustness"].T, strict=True):
        axis.plot(recording.time_s, values, linewidth=0.9, label=str(name))
    axis.plot(
        recording.time_s, recording["soft_min"], color="black", linestyle="--", linewidth=1.4, label="soft minimum"
    )
    axis.axhline(0, color="0.6", linewidth=0.6)
    axis.set_ylabel("requirements\nbroken below 0")
    legend(axis)


PANELS: tuple[Callable[[Axes, Recording], None], ...] = (_speeds, _accelerations, _distance, _ttc, _robustness)


def mark_instants(axis: Axes, recording: Recording) -> None:
    """Upright lines at the instants, and grey ground where the ego did not see the other."""
    axis.grid(visible=True, linewidth=0.3)
    for start, end in recording.hidden():
        axis.axvspan(start, end, color=HIDDEN_COLOUR, zorder=0)
    for time_s, _, colour in _instants(recording):
        axis.axvline(time_s, color=colour, linewidth=1.0, linestyle="--" if time_s == 0 else ":")


def name_instants(axis: Axes, recording: Recording) -> None:
    """Names above the first panel, each in a row of its own so that they do not cover each other."""
    for row, (time_s, name, colour) in enumerate(_instants(recording)):
        axis.annotate(
            name,
            (time_s, 1),
            (0, 3 + 9 * row),
            xycoords=axis.get_xaxis_transform(),
            textcoords="offset points",
            va="bottom",
            ha="right" if time_s == 0 else "left",
            fontsize=7,
            color=colour,
            annotation_clip=True,
        )


def _instants(recording: Recording) -> Iterator[tuple[float, str, str]]:
    """What there is to mark: when, its name, and its colour."""
    yield 0.0, "contact of the failure" if recording.twin else "contact", "black"
    if recording.collision.visible_for_s > 0 and not recording.twin:
        yield recording.time_s[-1] - recording.collision.visible_for_s, "in the ego's view from here", SEEN_COLOUR
    yield recording.released_s, "adversaries released", RELEASE_COLOUR
    if recording.conflict_s is not None:
        yield recording.conflict_s, "conflict begins", CONFLICT_COLOUR
