import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from risk_sac.config import Budget, RunSpec
from risk_sac.errors import ConfigError
from risk_sac.failures.show import Recording, draw, draw_recording
from risk_sac.run_folder.results import Contact
from risk_sac.run_folder.series import write_series
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.space import SceneSpace
from risk_sac.train import train
from risk_sac.types import Collision, ConflictType, EpisodeRecord, Judgement, Outcome, RunMetrics, SeriesFile
from tests.judged import judgement


def png_size(file: Path) -> tuple[int, int]:
    content = file.read_bytes()
    assert content.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", content[16:24])
    return width, height


JUDGED = judgement(
    conflict_type=ConflictType.PEDESTRIAN,
    conflict_s=0.75,
    conflict_x_m=302.0,
    conflict_y_m=-3.25,
    broke=("pedestrian_on_red",),
)


def synthetic_contact(judged: Judgement | None = JUDGED) -> Contact:
    """The ego drives east at 10 m/s into a pedestrian who walks north; the contact is 1.95 s after the release."""
    space: SceneSpace = FAMILIES["mixed"].space
    collision = Collision(
        time_s=1.95,
        other_id="pedestrian",
        other_kind="pedestrian",
        other_role="adversary",
        contact_x_m=2.3,
        contact_y_m=-0.5,
        ego_zone="front",
        other_zone="left",
        ego_speed_mps=10.0,
        other_speed_mps=1.0,
        relative_speed_mps=10.05,
        lateral_offset_m=-0.5,
        min_ttc_s=0.1,
        min_rss_margin_m=-3.0,
        visible_for_s=1.0,
        ego_peak_braking_mps2=0.0,
        min_robustness=-1.0,
        simulator_agrees=True,
        verdicts={"ego_moving": True},
        judgement=judged,
    )
    episode = EpisodeRecord(
        index=7,
        phase="train",
        seed=1,
        scene=space.from_unit(np.full(space.dimension, 0.4)).values,
        outcome=Outcome.FAILURE,
        reason="",
        steps=20,
        risk_return=1.0,
        shaped_return=1.0,
        mean_cost=0.1,
        min_ttc_s=0.1,
        min_robustness=-1.0,
        objective=0.0,
        dual_variable=0.0,
        temperature=0.2,
        environment_steps=20,
        collision=collision,
    )
    return Contact.of(episode)


def synthetic_series() -> dict[str, NDArray[np.generic]]:
    """Ego, the pedestrian, and a bystander that leaves the net after one second."""
    t = np.arange(21) * 0.1
    zero, gone = np.zeros_like(t), np.where(t < 1.0, 0.0, np.nan)
    return {
        "time_s": t + 0.1,
        "ids": np.array(["ego", "pedestrian", "bystander"]),
        "kind": np.array([0, 1, 0], dtype=np.int8),
        "role": np.array([0, 1, 2], dtype=np.int8),
        "length_m": np.array([4.6, 0.5, 4.6]),
        "width_m": np.array([1.85, 0.5, 1.85]),
        "requirements": np.array(["safe_ttc", "pedestrian_gap"]),
        "robustness": np.column_stack((1 - t, 2 - t)),
        "soft_min": 1 - t,
        "signal": np.zeros(21, dtype=np.int8),
        "x_m": np.column_stack((280 + 10 * t, zero + 302, gone + 260)),
        "y_m": np.column_stack((zero - 1.65, -4 + t, gone + 1.65)),
        "heading_rad": np.column_stack((zero, zero + np.pi / 2, gone + np.pi)),
        "speed_mps": np.column_stack((zero + 10, zero + 1, gone + 5)),
        "lateral_mps": np.column_stack((zero, zero, gone)),
        "accel_mps2": np.column_stack((zero, zero, gone)),
        "distance_m": np.column_stack((zero + np.nan, 20 - 10 * t, gone + 20)),
        "ttc_s": np.column_stack((zero + np.nan, 2 - t, gone + 10)),
        "rss_longitudinal_m": np.column_stack((zero + np.nan, zero, gone)),
        "rss_lateral_m": np.column_stack((zero + np.nan, zero, gone)),
        "visible": np.column_stack((zero + np.nan, t > 1.0, gone + 1)),
        "actions": np.zeros((21, 2)),
    }


def test_pose_at_the_contact_lies_between_the_frames() -> None:
    recording = Recording(synthetic_contact(), synthetic_series())
    assert recording.pose(0, 0.0) == pytest.approx((280 + 19.5, -1.65, 0.0))
    assert recording.pose(recording.other, -0.95) == pytest.approx((302, -3.0, np.pi / 2))


def with_release() -> dict[str, NDArray[np.generic]]:
    """The same with 1.5 s before the release, in which the ego drives as it does after and all others stand."""
    series, early = synthetic_series(), 15
    rows = len(series["time_s"])
    longer = {
        name: np.concatenate((np.repeat(values[:1], early, axis=0), values)) if len(values) == rows else values
        for name, values in series.items()
    }
    t = np.arange(early + rows) * 0.1 - 1.5
    x_m = longer["x_m"].copy()
    x_m[:, 0] = 280 + 10 * t
    return longer | {"time_s": t + 1.6, "x_m": x_m, "released_s": np.array(1.6)}


def test_frames_before_the_release_come_before_it() -> None:
    recording = Recording(synthetic_contact(), with_release())
    assert len(recording.time_s) == 36
    assert (recording.time_s[0], recording.time_s[-1]) == pytest.approx((-3.45, 0.05))
    assert recording.time_s[15] == pytest.approx(recording.released_s) == -1.95
    assert recording.pose(0, 0.0) == pytest.approx((280 + 19.5, -1.65, 0.0))
    assert recording.pose(0, -2.95) == pytest.approx((270, -1.65, 0.0))


def test_the_conflict_begins_as_long_before_the_contact_as_its_judgement_says() -> None:
    for series in (synthetic_series(), with_release()):
        assert Recording(synthetic_contact(), series).conflict_s == pytest.approx(-1.2)
    early = replace(JUDGED, conflict_s=-1.0)  # before the release
    assert Recording(synthetic_contact(early), with_release()).conflict_s == pytest.approx(-2.95)
    assert Recording(synthetic_contact(early), synthetic_series()).conflict_s is None  # which began at the release
    assert Recording(synthetic_contact(None), synthetic_series()).conflict_s is None


@pytest.mark.parametrize("conflict_s", [0.75, -1.0])
def test_release_and_conflict_are_marked_in_every_panel_and_the_conflict_from_above(conflict_s: float) -> None:
    contact = synthetic_contact(replace(JUDGED, conflict_s=conflict_s))
    view, *panels = draw_recording("mixed", Recording(contact, with_release())).axes
    for panel in panels:
        upright = [float(np.ravel(line.get_xdata())[0]) for line in panel.lines if line.get_linestyle() == ":"]
        assert upright == pytest.approx([-0.95, -1.95, conflict_s - 1.95])
        assert [text.get_text() for text in panel.texts] == ["in view", "release", "conflict"]
    (mark,) = (line for line in view.lines if line.get_label() == "conflict")
    assert (np.ravel(mark.get_xdata())[0], np.ravel(mark.get_ydata())[0]) == (302.0, -3.25)
    ghosts = [patch for patch in view.patches if patch.get_linestyle() == "--"]
    centres = [patch.get_path().vertices[:-1].mean(axis=0) for patch in ghosts]
    pedestrian_y = -4 + max(conflict_s, 0)
    np.testing.assert_allclose(centres, [(280 + 10 * conflict_s, -1.65), (302, pedestrian_y)])
    low, high = view.get_xlim()
    assert low < 280 + 10 * conflict_s < high


def test_the_title_says_who_would_have_prevented_it_and_what_the_striker_broke() -> None:
    figure = draw_recording("mixed", Recording(synthetic_contact(), with_release()))
    assert figure.get_suptitle().splitlines()[2:] == [
        "grade careful · pedestrian from 1.2 s before the contact, 0.8 s after the release, at (302.0, -3.2) m",
        "the striker broke pedestrian on red",
    ]
    nothing = replace(JUDGED, grade=None, broke=())
    title = draw_recording("mixed", Recording(synthetic_contact(nothing), with_release())).get_suptitle()
    assert title.splitlines()[2].startswith("no grade · pedestrian from")
    assert title.endswith("the striker broke nothing")


def test_a_contact_that_nobody_judged_is_drawn_without_a_conflict() -> None:
    figure = draw_recording("mixed", Recording(synthetic_contact(None), synthetic_series()))
    view, *panels = figure.axes
    assert len(figure.get_suptitle().splitlines()) == 2
    assert "conflict" not in [line.get_label() for line in view.lines]
    assert [text.get_text() for text in panels[0].texts] == ["in view", "release"]


def test_hidden_span_ends_where_the_other_comes_into_view() -> None:
    recording = Recording(synthetic_contact(), synthetic_series())
    assert [tuple(np.round(span, 6)) for span in recording.hidden()] == [(-1.95, -0.85)]


def test_contact_and_first_sight_are_marked_in_every_panel() -> None:
    figure = draw_recording("mixed", Recording(synthetic_contact(), synthetic_series()))
    assert isinstance(figure, Figure)
    panels = figure.axes[1:]
    assert len(panels) == 5
    for panel in panels:
        upright = [float(np.ravel(line.get_xdata())[0]) for line in panel.lines if line.get_linestyle() in ("--", ":")]
        assert any(x == 0 for x in upright)
        assert any(x == pytest.approx(-0.95) for x in upright)


def test_both_bodies_and_both_paths_are_drawn() -> None:
    view, *_ = draw_recording("mixed", Recording(synthetic_contact(), synthetic_series())).axes
    labels = [text.get_text() for text in view.get_legend().get_texts()]
    assert labels == ["pedestrian (adversary)", "ego", "contact", "conflict"]
    paths = [line for line in view.lines if len(np.ravel(line.get_xdata())) == 21]
    assert len(paths) == 3


def test_drawing_writes_a_picture_of_sensible_size(tmp_path: Path) -> None:
    contact = synthetic_contact()
    write_series(tmp_path / contact.series, synthetic_series())
    draw("mixed", contact, tmp_path, tmp_path / "new" / "contact.png")
    width, height = png_size(tmp_path / "new" / "contact.png")
    assert 800 <= width <= 2000
    assert 800 <= height <= 2500


def test_picture_of_an_unknown_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"contact.doc'; wanted a name that ends in .png"):
        draw("mixed", synthetic_contact(), tmp_path, tmp_path / "contact.doc")


class UntilContact:
    contact: Contact | None = None

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        if record.collision is not None:
            self.contact = Contact.of(record)
            assert series is not None
            assert self.contact.series == f"failures/{series.name}"

    def should_stop(self) -> bool:
        return self.contact is not None


def test_contact_of_a_real_run_can_be_drawn(tmp_path: Path) -> None:
    observer = UntilContact()
    train(RunSpec(family="low", method="random", seed=11, budget=Budget(episodes=200)), tmp_path, observer)
    assert observer.contact is not None
    draw("low", observer.contact, tmp_path, tmp_path / "contact.png")
    assert min(png_size(tmp_path / "contact.png")) >= 800
