import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely import Polygon, box

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.failures.net import EGO, HEIGHT, LETTERS, STRIKER, WIDTH, roads_of, signal_heads, thumbnail
from risk_sac.failures.recording import Recording, trajectory_digest
from risk_sac.failures.sentence import sentence, story
from risk_sac.failures.show import draw_recording
from risk_sac.records import ConflictType
from risk_sac.run_folder.results import RecordedFailure
from risk_sac.scenario.bodies import CODES
from risk_sac.scenario.families import FAMILIES
from risk_sac.world.read_net import read_net
from tests.builders import collision, judgement, violation
from tests.unit.failures.staged import JUDGED, synthetic_contact, synthetic_series, with_release


def test_pose_at_the_contact_lies_between_the_frames():
    recording = Recording(synthetic_contact(), synthetic_series())
    assert recording.pose(0, 0.0) == pytest.approx((280 + 19.5, -1.65, 0.0))
    assert recording.pose(recording.other, -0.95) == pytest.approx((302, -3.0, np.pi / 2))


def test_frames_before_the_release_come_before_it():
    recording = Recording(synthetic_contact(), with_release())
    assert len(recording.time_s) == 36
    assert (recording.time_s[0], recording.time_s[-1]) == pytest.approx((-3.45, 0.05))
    assert recording.time_s[15] == pytest.approx(recording.released_s) == -1.95
    assert recording.pose(0, 0.0) == pytest.approx((280 + 19.5, -1.65, 0.0))
    assert recording.pose(0, -2.95) == pytest.approx((270, -1.65, 0.0))


def test_the_conflict_begins_as_long_before_the_contact_as_its_judgement_says():
    for series in (synthetic_series(), with_release()):
        assert Recording(synthetic_contact(), series).conflict_s == pytest.approx(-1.2)
    early = JUDGED.model_copy(update={"conflict_s": -1.0})  # before the release
    assert Recording(synthetic_contact(early), with_release()).conflict_s == pytest.approx(-2.95)
    assert Recording(synthetic_contact(early), synthetic_series()).conflict_s is None  # which began at the release


def test_hidden_span_ends_where_the_other_comes_into_view():
    recording = Recording(synthetic_contact(), synthetic_series())
    assert [tuple(np.round(span, 6)) for span in recording.hidden()] == [(-1.95, -0.85)]


def series() -> dict[str, np.ndarray]:
    return {
        "time_s": np.arange(4.0),
        "released_s": np.array(1.0),
        "ids": np.array(["ego", "a"]),
        "x_m": np.ones((4, 2)),
    }


def test_the_digest_is_of_the_arrays_and_of_nothing_else():
    backwards = dict(reversed(series().items()))
    backwards["x_m"] = np.asfortranarray(backwards["x_m"])
    assert trajectory_digest(backwards) == trajectory_digest(series())


@pytest.mark.parametrize(
    "change",
    [
        {"x_m": np.nextafter(np.ones((4, 2)), 2)},
        {"x_m": np.ones((2, 4))},
        {"x_m": np.ones((4, 2), np.float32)},
        {"y_m": np.ones((4, 2))},
        {"ids": np.array(["ego", "b"])},
    ],
    ids=["a bit", "shape", "type", "one more", "a name"],
)
def test_the_digest_changes_with_every_bit(change):
    assert trajectory_digest(series() | change) != trajectory_digest(series())


def scene(family: FamilyName, offset_s: float) -> dict[str, float]:
    parameters = FAMILIES[family].space.parameters
    return {each.name: (each.low + each.high) / 2 for each in parameters} | {"signal_offset_s": offset_s}


@pytest.mark.parametrize("offset_s", [0.0, 7.1, 34.8])
@pytest.mark.parametrize(("family", "heads"), [("low", 0), ("mixed", 6), ("dense", 16)])
def test_heads_show_what_the_program_shows_from_where_the_scene_puts_it(family, heads, offset_s):
    found = signal_heads(family, scene(family, offset_s))
    assert len(found) == heads
    net = read_net(Path(sumo_nets.__path__[0]) / family / f"{family}.net.xml")
    ends = {tuple(lane.centre[-1]): lane for lane in net.lanes.values() if lane.heads}
    compared = 0
    for head in found:
        lane = ends.get((head.x_m, head.y_m))
        if lane is None:
            continue  # the other end of a crossing
        link = next(each for each in lane.heads if each.turn == "s")
        for time_s in np.arange(0.1, 25.0, 0.1):
            letters = net.programs[link.signal].letters(offset_s + time_s)
            assert head.colour(time_s) == LETTERS[letters[link.index].lower()]
        compared += 1
    assert compared == len(ends)


SVG = "{http://www.w3.org/2000/svg}"


def drawn(series: Mapping[str, Any], roads: bool = True) -> list[ET.Element]:
    """The shapes, as a reader of XML finds them."""
    contact = synthetic_contact()
    text = thumbnail(Recording(contact, series), roads_of("mixed", contact.episode.scene) if roads else ())
    root = ET.fromstring(text)
    assert (root.tag, root.get("viewBox")) == (f"{SVG}svg", f"0 0 {WIDTH} {HEIGHT}")
    assert not re.search(r"nan|inf|\d\.\d\d", text)
    return list(root)


def points(shape: ET.Element) -> np.ndarray:
    return np.array([[float(value) for value in point.split(",")] for point in shape.get("points", "").split()])


def body(shapes: list[ET.Element], colour: str) -> ET.Element:
    (found,) = (shape for shape in shapes if shape.get("fill") == colour)
    return found


def turned(series: Mapping[str, Any], by_rad: float, far_m: float = 0.0) -> dict[str, Any]:
    """The same encounter elsewhere and in another direction."""
    cos, sin = np.cos(by_rad), np.sin(by_rad)
    x, y = series["x_m"] - 300.0, series["y_m"]
    place = {"x_m": x * cos - y * sin + far_m, "y_m": x * sin + y * cos - far_m}
    return dict(series) | place | {"heading_rad": series["heading_rad"] + by_rad}


@pytest.mark.parametrize("by_rad", np.linspace(0, 2 * np.pi, 9))
@pytest.mark.parametrize("far_m", [0.0, 700.0])
def test_both_bodies_are_seen_and_touch_whatever_their_direction(by_rad, far_m):
    shapes = drawn(turned(synthetic_series(), by_rad, far_m), roads=False)
    ego, walker = Polygon(points(body(shapes, EGO))), body(shapes, STRIKER)
    assert box(0, 0, WIDTH, HEIGHT).contains(ego)
    left, top, radius = (float(walker.get(name, "")) for name in ("cx", "cy", "r"))
    assert 0 < left < WIDTH
    assert 0 < top < HEIGHT
    assert ego.distance(box(left, top, left, top)) <= radius
    length, width = sorted(np.hypot(*np.diff(points(body(shapes, EGO)), axis=0).T))[::-2]
    series = synthetic_series()
    assert length / width == pytest.approx(series["length_m"][0] / series["width_m"][0], rel=0.05)


def test_north_is_up_and_an_arrow_head_points_to_where_a_car_heads():
    for by_rad, ahead in ((0.0, (1, 0)), (np.pi / 2, (0, -1)), (np.pi, (-1, 0))):
        shapes = drawn(turned(synthetic_series(), by_rad), roads=False)
        (head,) = (shape for shape in shapes if shape.get("fill") == "#fff")
        _, tip, _ = points(head)
        away = tip - points(body(shapes, EGO)).mean(axis=0)
        np.testing.assert_allclose(away / np.hypot(*away), ahead, atol=0.1)


def test_a_violation_near_nothing_shows_the_ego_and_its_path_up_to_then():
    episode = synthetic_contact().episode.model_copy(update={"collision": None, "violations": (violation(time_s=1.0),)})
    shapes = list(ET.fromstring(thumbnail(Recording(RecordedFailure.of("a", episode), synthetic_series()), ())))
    assert not [shape for shape in shapes if shape.get("fill") == STRIKER]
    (path,) = (shape for shape in shapes if shape.get("stroke") == EGO)
    assert len(points(path)) == pytest.approx(11, abs=1)
    end, ego = points(path)[-1], points(body(shapes, EGO)).mean(axis=0)
    np.testing.assert_allclose(end, ego, atol=5.0)


RELEASE = 5  # frames before it
ROWS = 41


def encounter(*, kind: int = 0, x_m: float = 4.0, y_m: float = 3.2, heading: float = 0.0, **of_striker: Any) -> Any:
    """Ego at 14 m/s eastward with a striker beside, for 4 s."""
    zero = np.zeros(ROWS)
    columns = {
        "x_m": (14.0 * np.arange(ROWS) / 10, 14.0 * np.arange(ROWS) / 10 + x_m),
        "y_m": (zero, zero + y_m),
        "heading_rad": (zero, zero + heading),
        "speed_mps": (zero + 14.0, zero + of_striker.get("speed_mps", 14.0)),
        "accel_mps2": (of_striker.get("ego_accel_mps2", zero), of_striker.get("accel_mps2", zero)),
        "lateral_mps": (zero, of_striker.get("lateral_mps", zero)),
    }
    return {
        **{name: np.column_stack(pair) for name, pair in columns.items()},
        "time_s": np.arange(ROWS) / 10,
        "released_s": np.array(RELEASE / 10),
        "ids": np.array(["ego", "lead"]),
        "kind": np.array([0, kind], np.int8),
        "body": np.array([CODES["car"], CODES["pedestrian" if kind else "car"]], np.int8),
        "role": np.array([0, 1], np.int8),
    }


def during(first_s: float, last_s: float, value: float) -> np.ndarray:
    """A value between two times since the release, and else nothing."""
    time_s = (np.arange(ROWS) - RELEASE) / 10
    return np.where((time_s > first_s - 0.05) & (time_s < last_s - 0.05), value, 0.0)


def said(
    response: str = "none",
    broke: tuple[str, ...] = (),
    ego_broke: tuple[str, ...] = (),
    of_judgement: dict[str, Any] | None = None,
    **changes: Any,
) -> str:
    stated = {"broke": broke, "ego_broke": ego_broke, "ego_response": response, **(of_judgement or {})}
    judged = judgement(conflict_s=1.0, **stated)
    return sentence(encounter(**changes), collision(time_s=3.5, judgement=judged))


def test_a_neighbour_that_moves_over_while_the_ego_brakes_late():
    late = said("late_braking", lateral_mps=during(1.0, 2.5, -1.1), ego_accel_mps2=during(2.65, 3.5, -3.0))
    assert late == "left neighbour, 4 m ahead, moves right at 1.1 m/s for 1.5 s; ego at 14 m/s brakes 0.6 s late"


def test_in_the_mirror_the_sides_are_exchanged():
    mirrored = said(y_m=-3.2, lateral_mps=during(1.0, 2.5, 1.1))
    assert mirrored == "right neighbour, 4 m ahead, moves left at 1.1 m/s for 1.5 s; ego at 14 m/s does not brake"


@pytest.mark.parametrize(
    ("who", "where"),
    [
        ("leader, 12 m ahead", {"x_m": 12.0, "y_m": 0.3}),
        ("oncoming vehicle, 30 m ahead", {"x_m": 30.0, "heading": math.pi}),
        ("vehicle from the right, 15 m ahead", {"x_m": 15.0, "y_m": -9.0, "heading": math.pi / 2}),
        ("vehicle from the left, 15 m ahead", {"x_m": 15.0, "y_m": 9.0, "heading": -math.pi / 2}),
        ("vehicle from the right, 15 m ahead", {"x_m": 15.0, "y_m": 2.0, "heading": math.pi / 2}),  # past the middle
        ("pedestrian on the right, 9 m ahead", {"x_m": 9.0, "y_m": -3.2, "kind": 1, "heading": math.pi / 2}),
        ("pedestrian on the left, 9 m ahead", {"x_m": 9.0, "kind": 1, "heading": -math.pi / 2}),
        ("left neighbour, 2 m behind", {"x_m": -2.0}),
        ("left neighbour, level with it", {"x_m": 0.2}),
    ],
)
def test_who_strikes_is_told_from_where_it_is(who, where):
    assert said(**where).startswith(f"{who}, goes on at 14 m/s; ")


@pytest.mark.parametrize("side", [1, -1])
def test_the_vehicle_ahead_leads_wherever_the_ego_has_swerved_to(side):
    beside = {"x_m": 12.0, "y_m": 3.2 * side}
    assert "neighbour" in said(**beside)
    assert said(of_judgement={"conflict_type": ConflictType.LEADER}, **beside).startswith("leader, 12 m ahead")


def test_the_sentence_tells_the_ego_s_manoeuvre_and_that_the_striker_was_hidden():
    told = said(of_judgement={"hidden": True, "ego_manoeuvre": "lane_change"})
    assert (
        told == "left neighbour from hiding, 4 m ahead, goes on at 14 m/s; ego at 14 m/s changing lanes does not brake"
    )


def test_an_ego_that_stops_in_the_conflict_is_told_apart_from_one_that_stood_before():
    stops = encounter()
    stops["speed_mps"][-RELEASE:, 0] = 0.2
    starts = collision(time_s=3.5, judgement=judgement(conflict_s=1.0, ego_response="starting"))
    assert sentence(stops, starts).endswith("stops, then starts")
    assert sentence(encounter(), starts).endswith("ego at 14 m/s starts")


@pytest.mark.parametrize("side", [1, -1])
def test_a_flicker_of_motion_is_not_told(side):
    flicker = during(1.0, 1.2, 0.3 * side)
    assert "goes on at 14 m/s" in said(lateral_mps=flicker)
    assert "goes on at 14 m/s" in said(accel_mps2=np.sign(flicker) * 1.4)


def test_a_violation_without_contact_tells_what_the_nearest_actor_did_until_then():
    braking = encounter(x_m=20.0, y_m=0.0, accel_mps2=during(0.5, 3.0, -4.0))
    told = story(braking, violation(time_s=1.5, other_id="lead", ego_speed_mps=14.0, broke=("speeding",)))
    assert told == "leader, 20 m ahead, brakes at 4.0 m/s² for 1.1 s; ego at 14 m/s speeding violates never_fast"
    assert story(braking, violation(time_s=0.0)) == "ego at 9 m/s violates never_fast"


@pytest.mark.parametrize("conflict_s", [0.75, -1.0])
def test_what_happens_is_marked_in_every_panel_and_the_conflict_from_above(conflict_s):
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


def test_no_label_covers_another_nor_a_body():
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
