"""Draws one failure like the paper's Fig. 2: paths and measures."""

import textwrap
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from risk_sac.config import FamilyName
from risk_sac.errors import ConfigError
from risk_sac.failures import from_above
from risk_sac.failures.recording import Recording
from risk_sac.records import Collision, Violation
from risk_sac.risk.rss import TTC_CAP_S
from risk_sac.world.types import STEP_S, Floats

CAPTION_WIDTH = 120  # width of a caption's lines, in characters
SEEN_COLOUR, RELEASE_COLOUR, HIDDEN_COLOUR, ALSO_COLOUR = "tab:green", "tab:purple", "0.9", "tab:brown"
VIEW_S, PANELS_S = 3.0, 8.0  # before the violation: what the view from above holds, and the panels
AFTER_S = 3.0  # time that panels show after a violation without contact
MARGIN_M = 5.0
LEAST_M = 5.0  # least range of a scale of distances
WIDTH_IN, PANEL_IN, DPI = 11.0, 1.5, 110
PANEL_WIDTH_IN = 8.7  # width of a panel without its legend and labels
VIEW_IN = (2.2, 6.0)  # least and greatest height of the view from above


def caption(family: FamilyName, recording: Recording) -> str:
    """Returns which failure it is, what happened, and how it was judged."""
    episode, violation = recording.failure.episode, recording.violation
    refused = f" · failed rules: {_words(episode.reason)}" if episode.reason else ""
    drove = f" · driven by {episode.driven_by}" if episode.driven_by else ""
    also = [name for name in episode.failed if name != violation.requirement]
    lines = [
        f"{family} · episode {recording.failure.id} · {episode.outcome}{refused}{drove}",
        *(_contact(violation) if isinstance(violation, Collision) else _violation(violation)),
        *([f"also violated: {', '.join(also)}"] if also else []),
    ]
    return "\n".join(textwrap.fill(line, CAPTION_WIDTH) for line in lines)


def _contact(collision: Collision) -> Iterator[str]:
    judgement = collision.judgement
    yield (
        f"the ego's {collision.ego_zone}, at {collision.ego_speed_mps:.1f} m/s, touched the {collision.other_zone} of "
        f"{collision.other_role} {collision.other_id!r}, at {collision.other_speed_mps:.1f} m/s, "
        f"{collision.view_in_words}"
    )
    yield judgement.kind
    yield judgement.variant
    yield collision.severity_in_words
    yield f"{collision.conflict_in_words}{_grade(collision)}"
    if judgement.plausibility is not None:
        yield judgement.plausibility.in_words
    if judgement.ego_part is not None:
        yield f"fault: {judgement.fault} · the ego {judgement.ego_part.in_words}"
    yield (
        f"broken by the other: {_words(', '.join(judgement.broke)) or 'nothing'} · "
        f"by the ego: {_words(', '.join(judgement.ego_broke)) or 'nothing'}"
    )


def _violation(violation: Violation) -> Iterator[str]:
    met = ""
    if violation.other_id is not None:
        unseen = ", of which it did not know" if violation.hidden else ""
        met = f"; it would have met {violation.other_role} {violation.other_id!r} first{unseen}"
    yield f"the ego, at {violation.ego_speed_mps:.1f} m/s, violated {violation.requirement}{met}"
    yield violation.kind
    yield violation.variant
    yield f"least robustness: {violation.robustness:.2f}{_grade(violation)}"
    if violation.plausibility is not None:
        yield violation.plausibility.in_words
    fault = f" · fault: {violation.fault}" if violation.fault is not None else ""
    yield f"the ego's offences: {_words(', '.join(violation.broke)) or 'none'}{fault}"


def _grade(violation: Collision | Violation) -> str:
    prevented = violation.prevention_in_words
    return f" · grade {violation.graded}: {prevented}" if prevented else ""


def _words(names: str) -> str:
    return names.replace("_", " ")


def _speeds(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "speed_mps")
    axis.set_ylabel("speed\nm/s")
    if any(True for _ in recording.hidden()):
        axis.add_patch(Rectangle((0, 0), 0, 0, color=HIDDEN_COLOUR, label="hidden from the ego"))
    from_above.legend(axis)


def _accelerations(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "accel_mps2")
    axis.set_ylabel("acceleration\nm/s²")


def _both(axis: Axes, recording: Recording, name: str) -> None:
    for actor, colour in zip(recording.involved, (from_above.EGO_COLOUR, from_above.OTHER_COLOUR), strict=False):
        label = str(recording.series["ids"][actor])
        axis.plot(recording.time_s, recording[name][:, actor], color=colour, linewidth=1.2, label=label)


def _distance(axis: Axes, recording: Recording) -> None:
    _to_the_other(axis, recording, "distance_m")
    axis.set_ylabel("distance\nm")
    if not recording.twin:  # which has the failure's scale
        axis.set_ylim(0, _near_m(recording))


def _near_m(recording: Recording) -> float:
    """Returns a scale for distances from 1 s before the conflict on."""
    began_s = -VIEW_S if recording.conflict_s is None else recording.conflict_s
    near = _least(recording, "distance_m")[recording.time_s >= began_s - 1.0]
    return 1.08 * max([LEAST_M, *map(float, near[np.isfinite(near)])])


def _ttc(axis: Axes, recording: Recording) -> None:
    _to_the_other(axis, recording, "ttc_s")
    axis.set(ylabel=f"time to\ncollision, s\n({TTC_CAP_S:g}: none)", ylim=(0, TTC_CAP_S * 1.05))


def _to_the_other(axis: Axes, recording: Recording, name: str) -> None:
    axis.plot(recording.time_s, _least(recording, name), color="black", linewidth=1.2)


def _least(recording: Recording, name: str) -> Floats:
    """Returns a measure to the other, or the least of all, `T`."""
    values = recording[name]
    least: Floats = np.fmin.reduce(values, axis=1) if recording.other is None else values[:, recording.other]
    return least


def _robustness(axis: Axes, recording: Recording) -> None:
    for name, values in zip(recording.series["requirements"], recording["robustness"].T, strict=True):
        width = 2.2 if str(name) == recording.violation.requirement else 0.9
        axis.plot(recording.time_s, values, linewidth=width, label=str(name))
    axis.plot(
        recording.time_s, recording["soft_min"], color="black", linestyle="--", linewidth=1.4, label="soft minimum"
    )
    axis.axhline(0, color="0.6", linewidth=0.6)
    axis.set_ylabel("requirements\nviolated below 0")
    from_above.legend(axis)


PANELS: tuple[Callable[[Axes, Recording], None], ...] = (_speeds, _accelerations, _distance, _ttc, _robustness)


def _mark_instants(axis: Axes, recording: Recording) -> None:
    """Draws vertical lines at instants, and grey where the other is hidden."""
    axis.grid(visible=True, linewidth=0.3)
    for start, end in recording.hidden():
        axis.axvspan(start, end, color=HIDDEN_COLOUR, zorder=0)
    for time_s, _, colour in _instants(recording):
        axis.axvline(time_s, color=colour, linewidth=1.0, linestyle="--" if time_s == 0 else ":")


def _name_instants(axis: Axes, recording: Recording) -> None:
    """Writes names above the first panel, each in its own row."""
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
    yield 0.0, recording.moment + (" in the failure" if recording.twin else ""), "black"
    if recording.collision is not None and recording.collision.visible_for_s > 0 and not recording.twin:
        yield recording.time_s[-1] - recording.collision.visible_for_s, "in the ego's view from here", SEEN_COLOUR
    for other in () if recording.twin else recording.failure.episode.valid_violations:
        if other is not recording.violation:
            yield other.time_s - recording.violation.time_s, f"{other.requirement} violated", ALSO_COLOUR
    yield recording.released_s, "adversaries released", RELEASE_COLOUR
    if recording.conflict_s is not None:
        yield recording.conflict_s, "conflict begins", from_above.CONFLICT_COLOUR


def draw(family: FamilyName, recording: Recording, file: Path, twin: Recording | None = None) -> None:
    """Draws a failure, with its twin beside, as png, pdf or svg."""
    if file.suffix not in (".png", ".pdf", ".svg"):
        raise ConfigError("out", f"{str(file)!r}", "a name that ends in .png, .pdf or .svg")
    content = recording_bytes(family, recording, file.suffix.removeprefix("."), twin)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)


def recording_bytes(family: FamilyName, recording: Recording, format_: str, twin: Recording | None = None) -> bytes:
    """Returns the picture of a failure as a png, pdf or svg."""
    return from_above.picture(partial(draw_recording, family, recording, twin), [format_], DPI, {})[0]


def draw_recording(family: FamilyName, recording: Recording, twin: Recording | None = None) -> Figure:
    """Draws the view from above, and a panel per kind of measurement.

    A twin stands beside it, on the same scales.
    """
    columns = [recording] if twin is None else [recording, twin]
    low, high = _extent(recording)
    view_in = PANEL_WIDTH_IN * (high - low)[1] / (high - low)[0]
    heights = (view_in, *(PANEL_IN for _ in PANELS))
    figure = from_above.canvas((WIDTH_IN * len(columns), sum(heights) + 1.2))
    grid = figure.subplots(len(heights), len(columns), height_ratios=heights, squeeze=False)
    figure.suptitle(caption(family, recording), fontsize=11)
    for column, (view, *axes) in zip(columns, grid.T, strict=True):
        from_above.draw_from_above(view, family, column, (low, high), m_per_in=(high - low)[0] / PANEL_WIDTH_IN)
        view.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        if twin is not None:
            view.set_title(column.twin or "the failure", fontsize=10)
        for axis, panel, first in zip(axes, PANELS, grid[1:, 0], strict=True):
            axis.sharex(grid[1, 0])
            if axis is not first:
                axis.sharey(first)  # before anything is drawn, so that there is room for both
            panel(axis, column)
            _mark_instants(axis, column)
            axis.label_outer()
        _name_instants(axes[0], column)
        axes[-1].set_xlabel(f"time from the {'contact' if column.collision else 'violation'}, s")
    after_s = max(0.15, *(min(each.time_s[-1], AFTER_S) for each in columns))
    grid[1, 0].set_xlim(max(recording.time_s[0], -PANELS_S), after_s)
    return figure


def _extent(recording: Recording) -> tuple[Floats, Floats]:
    """Computes corners of the ground of both bodies, fitted to the page."""
    begin_s = recording.conflict_s
    shown = recording.time_s >= min(-VIEW_S, max(begin_s, -PANELS_S) if begin_s is not None else 0.0)
    shown &= recording.time_s < STEP_S
    bodies = list(recording.involved)
    points = np.concatenate([recording[name][shown][:, bodies].reshape(1, -1) for name in ("x_m", "y_m")])
    low, high = np.nanmin(points, axis=1) - MARGIN_M, np.nanmax(points, axis=1) + MARGIN_M
    width, height = high - low
    height = max(height, width * VIEW_IN[0] / PANEL_WIDTH_IN)
    width = max(width, height * PANEL_WIDTH_IN / VIEW_IN[1])
    middle, half = (low + high) / 2, np.array((width, height)) / 2
    return middle - half, middle + half
