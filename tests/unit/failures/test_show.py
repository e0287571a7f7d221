from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from risk_sac.errors import ConfigError
from risk_sac.failures.recording import Recording
from risk_sac.failures.show import CAPTION_WIDTH, caption, draw, draw_recording
from risk_sac.records import Grade, Outcome, Severity
from risk_sac.run_folder.results import RecordedFailure
from tests.builders import TOUCHES, episode_record, violation
from tests.unit.failures.staged import JUDGED, synthetic_contact, synthetic_series, with_release


@pytest.mark.parametrize("conflict_s", [0.75, -1.0])
def test_what_happens_is_marked_in_every_panel_and_the_conflict_from_above(conflict_s: float) -> None:
    contact = synthetic_contact(JUDGED.model_copy(update={"conflict_s": conflict_s}))
    view, *panels = draw_recording("mixed", Recording(contact, with_release())).axes
    assert len(panels) == 5
    for panel in panels:
        dotted, dashed = (
            [float(np.ravel(line.get_xdata())[0]) for line in panel.lines if line.get_linestyle() == style]
            for style in (":", "--")
        )
        assert dotted == pytest.approx([-0.95, -1.95, conflict_s - 1.95])
        assert 0.0 in dashed  # the contact
    (mark,) = (line for line in view.lines if line.get_marker() == "D")
    assert (np.ravel(mark.get_xdata())[0], np.ravel(mark.get_ydata())[0]) == (302.0, -3.25)
    ghosts = [patch for patch in view.patches if patch.get_linestyle() == "--"]
    centres = [patch.get_path().vertices[:-1].mean(axis=0) for patch in ghosts]
    pedestrian_y = -4 + max(conflict_s, 0)
    np.testing.assert_allclose(centres, [(280 + 10 * conflict_s, -1.65), (302, pedestrian_y)])
    low, high = view.get_xlim()
    assert low < 280 + 10 * conflict_s < high


def test_instants_are_named_once_above_the_panels_where_no_curve_runs() -> None:
    _, *panels = draw_recording("mixed", Recording(synthetic_contact(), with_release())).axes
    names = ["contact", "in the ego's view from here", "adversaries released", "conflict begins"]
    assert [text.get_text() for text in panels[0].texts] == names
    heights = [text.xyann[1] for text in panels[0].texts]
    assert all(height > 0 for height in heights)
    assert len(set(heights)) == len(heights)
    assert not any(panel.texts for panel in panels[1:])


def test_earlier_places_of_a_body_that_stands_are_labelled_together() -> None:
    series = with_release()
    still = series | {"x_m": np.where(np.arange(3) == 0, 300.0, series["x_m"])}
    view, *_ = draw_recording("mixed", Recording(synthetic_contact(), still)).axes
    labels = [text.get_text() for text in view.texts]
    assert labels[-1] == "−0.5, −1, −2, −3 s"
    moving, *_ = draw_recording("mixed", Recording(synthetic_contact(), series)).axes
    assert [text.get_text() for text in moving.texts][-4:] == ["−0.5 s", "−1 s", "−2 s", "−3 s"]


def test_a_contact_that_nobody_judged_is_drawn_without_a_conflict() -> None:
    figure = draw_recording("mixed", Recording(synthetic_contact(None), synthetic_series()))
    view, *panels = figure.axes
    assert "conflict" not in figure.get_suptitle()
    assert not [line for line in view.lines if line.get_marker() == "D"]
    assert "conflict begins" not in [text.get_text() for text in panels[0].texts]


def test_both_bodies_and_both_paths_are_drawn() -> None:
    view, *_ = draw_recording("mixed", Recording(synthetic_contact(), synthetic_series())).axes
    labels = [text.get_text() for text in view.get_legend().get_texts()]
    drawn = ["pedestrian (adversary)", "ego", "touched here", "as the conflict began", "striker then", "earlier"]
    signals = ["signal: green", "signal: yellow", "signal: red"]
    assert sorted(labels) == sorted([*drawn, "others", "paths", *signals])
    paths = [line for line in view.lines if len(np.ravel(line.get_xdata())) == 21]
    assert len(paths) == 3


def test_a_twin_is_drawn_beside_the_failure_on_the_same_ground_clock_and_scales() -> None:
    failure = Recording(synthetic_contact(), with_release())
    later = {name: values + 2.0 if name == "time_s" else values for name, values in with_release().items()}
    twin = Recording(failure.failure, later, "no attack")
    axes = draw_recording("mixed", failure, twin).axes
    rows = list(zip(axes[::2], axes[1::2], strict=True))
    assert [view.get_title() for view in rows[0]] == ["the failure", "no attack"]
    for left, right in rows:
        assert left.get_xlim() == right.get_xlim()
        assert left.get_ylim() == right.get_ylim()
    assert rows[1][0].get_xlim()[1] >= twin.time_s[-1] > 0.0
    of_the_twin = [text.get_text() for text in rows[1][1].texts]
    assert of_the_twin == ["contact in the failure", "adversaries released"]
    assert "touched here" not in [text.get_text() for text in rows[0][1].get_legend().get_texts()]


def test_picture_of_an_unknown_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"contact.doc'; wanted a name that ends in .png"):
        draw("mixed", Recording(synthetic_contact(), synthetic_series()), tmp_path / "contact.doc")


def lines(**judged: object) -> list[str]:
    contact = synthetic_contact(JUDGED.model_copy(update=judged))
    return caption("mixed", Recording(contact, with_release())).splitlines()


def test_the_title_says_who_would_have_prevented_it_and_what_the_striker_broke() -> None:
    assert lines() == [
        "mixed · episode low-random-0-search-7 · failure",
        "the ego's front, at 10.0 m/s, touched the left of adversary 'pedestrian', at 1.0 m/s, "
        "of which it had known for 1.0 s",
        JUDGED.signature,
        "moderate: closing speed 10.1 m/s, risk of death 0.5 %",
        "the conflict began 1.2 s before the contact · grade preventable: R157's driver and full braking at once "
        "would have",
        "prevented it",
        "broken by the other: pedestrian on red · by the ego: nothing",
    ]
    assert lines(grade=None, drivers={}, broke=())[-2:] == [
        "the conflict began 1.2 s before the contact",
        "broken by the other: nothing · by the ego: nothing",
    ]
    assert lines(broke=(), ego_broke=("red_light",))[-1] == "broken by the other: nothing · by the ego: red light"
    assert " ".join(lines(grade=Grade.UNAVOIDABLE, drivers={"r157": TOUCHES, "full_braking": TOUCHES})[-3:-1]).endswith(
        "grade unavoidable: none of the reference drivers would have prevented it"
    )


def test_the_title_says_how_bad_the_contact_is() -> None:
    said = "severe: closing speed 10.1 m/s, risk of death 2.6 %"
    assert said not in lines()
    assert said in lines(severity=Severity.SEVERE, injury_risk=0.026)


def test_rules_that_the_contact_failed_are_named_in_full_on_lines_that_the_page_holds() -> None:
    contact = synthetic_contact()
    rules = "conflict_after_release, inside_limits, inside_grip, solid_bodies, ego_model_saw, ego_moving, no_sideswipe"
    failed = contact.episode.model_copy(update={"outcome": Outcome.DEGENERATE, "reason": rules})
    title = caption("mixed", Recording(replace(contact, episode=failed), with_release()))
    assert max(map(len, title.splitlines())) <= CAPTION_WIDTH
    assert rules.replace("_", " ") in title.replace("\n", " ")


@pytest.mark.parametrize("other_id", ["pedestrian", None])
def test_a_violation_without_contact_is_marked_while_the_episode_goes_on(other_id: str | None) -> None:
    near = {"other_id": other_id, "other_kind": "pedestrian", "other_role": "adversary"} if other_id else {}
    drivers = {"r157": True, "full_braking": False}
    broken = violation(requirement="safe_ttc", time_s=1.0, grade=Grade.PREVENTABLE, drivers=drivers, **near)
    episode = episode_record(7, Outcome.FAILURE, scene=synthetic_contact().episode.scene, violations=(broken,))
    recording = Recording(RecordedFailure.of("low-random-0", episode), with_release())
    figure = draw_recording("mixed", recording)
    view, *panels = figure.axes
    bodies = [text.get_text() for text in view.get_legend().get_texts()]
    assert ("pedestrian (adversary)" in bodies, "ego" in bodies) == (other_id is not None, True)
    assert "touched here" not in bodies
    (ego,) = (patch for patch in view.patches if patch.get_label() == "ego")
    np.testing.assert_allclose(ego.get_path().vertices[:-1].mean(axis=0), (290.0, -1.65))  # as it was violated
    assert [text.get_text() for text in panels[0].texts] == ["safe_ttc violated", "adversaries released"]
    assert all(panel.lines for panel in panels)
    assert panels[0].get_xlim()[1] == pytest.approx(recording.time_s[-1]) == pytest.approx(1.0)
    bold = [line.get_label() for line in panels[-1].lines if line.get_linewidth() > 2]
    assert bold == ["safe_ttc"]
    title = figure.get_suptitle()
    assert "the ego, at 9.0 m/s, violated safe_ttc" in title
    assert ("'pedestrian' first" in title) == (other_id is not None)
    assert "grade preventable: R157's driver would have prevented it" in title


def test_other_violations_of_the_episode_are_marked_and_named() -> None:
    contact = synthetic_contact()
    both = {"failed": ("no_contact", "safe_ttc"), "violations": (violation(requirement="safe_ttc", time_s=1.0),)}
    recording = Recording(replace(contact, episode=contact.episode.model_copy(update=both)), with_release())
    assert caption("mixed", recording).splitlines()[-1] == "also violated: safe_ttc"
    _, panel, *_ = draw_recording("mixed", recording).axes
    (mark,) = (text for text in panel.texts if text.get_text() == "safe_ttc violated")
    assert mark.xy[0] == pytest.approx(-0.95)


def test_no_label_covers_another_nor_a_body() -> None:
    series, crowd = with_release(), 6
    several = {
        name: np.concatenate([values, *[values[..., -1:]] * crowd], axis=-1)
        for name, values in series.items()
        if values.shape and values.shape[-1] == len(series["ids"])
    }
    apart = np.concatenate((np.zeros(2), np.arange(crowd + 1) * 1.2))
    several["x_m"] = np.concatenate((several["x_m"][:, :2], np.full((len(several["x_m"]), crowd + 1), 290.0)), axis=1)
    several["y_m"], several["heading_rad"] = (np.nan_to_num(several[name]) for name in ("y_m", "heading_rad"))
    several["y_m"] = several["y_m"] + apart
    several["ids"] = np.array(["ego", "pedestrian", *(f"bystander_{k}" for k in range(crowd + 1))])
    figure = draw_recording("mixed", Recording(synthetic_contact(), series | several))
    figure.draw_without_rendering()
    view = figure.axes[0]
    boxes = [text.get_window_extent() for text in view.texts]
    assert {"bystander_0", "−1 s"} <= {text.get_text() for text in view.texts}
    assert not [1 for k, box in enumerate(boxes) for other in boxes[:k] if box.overlaps(other)]
    (ego,) = (patch.get_window_extent() for patch in view.patches if patch.get_label() == "ego")
    assert not [box for box in boxes if box.overlaps(ego)]


def test_distances_have_the_scale_of_the_conflict() -> None:
    series = with_release()
    far = series | {"distance_m": np.where(series["time_s"][:, None] < 0.5, 150.0, series["distance_m"])}
    _, _, _, distance, *_ = draw_recording("mixed", Recording(synthetic_contact(), far)).axes
    assert distance.get_ylim()[1] < 40.0
