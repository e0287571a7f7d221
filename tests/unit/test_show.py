import struct
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from risk_sac.config import Budget, RunSpec
from risk_sac.errors import ConfigError
from risk_sac.results import Contact
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.space import SceneSpace
from risk_sac.show import Recording, draw, draw_recording
from risk_sac.trace import write_series
from risk_sac.train import train
from risk_sac.types import Collision, EpisodeRecord, Outcome, RunMetrics, SeriesFile


def png_size(file: Path) -> tuple[int, int]:
    content = file.read_bytes()
    assert content.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", content[16:24])
    return width, height


def synthetic_contact() -> Contact:
    """The ego drives east at 10 m/s into a pedestrian who walks north; the contact is 1.95 s after the start."""
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
    assert labels == ["pedestrian (adversary)", "ego", "contact"]
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
