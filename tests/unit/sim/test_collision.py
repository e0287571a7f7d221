"""The oracle on hand-made frames; `tests/integration/test_oracle.py` holds it against SUMO's own list."""

import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.geometry import relative_view
from risk_sac.sim.collision import Contact, History, agrees, find_contact, verdicts
from risk_sac.types import ARTEFACT_RULES, STEP_S, Frame, Kind, Role, Signal

LENGTH_M, WIDTH_M = 4.6, 1.85
START_S = 0.1
CAR, WALKER = Kind.VEHICLE, Kind.PEDESTRIAN
Actor = tuple[float, float, float, float, float, Kind]  # x, y, heading, vx, vy at the end of the step, kind


def frames(
    *actors: Actor, step_s: float = STEP_S, time_s: float = 5.0, share: float = 0.5, ids: tuple[str, ...] | None = None
) -> tuple[Frame, Frame]:
    """Two frames around an instant at which the actors stand as given: `share` of the step lies before it.

    The first actor is the ego; everybody keeps velocity and heading.
    """
    columns = np.array([actor[:5] for actor in actors], dtype=np.float64).T
    kinds = [actor[5] for actor in actors]
    n = len(actors)

    def at(offset_s: float) -> Frame:
        return Frame(
            time_s=time_s + offset_s,
            ids=ids or tuple(f"actor_{i}" for i in range(n)),
            kind=np.array(kinds, dtype=np.int8),
            role=np.array([Role.EGO] + [Role.ADVERSARY] * (n - 1), dtype=np.int8),
            x_m=columns[0] + columns[3] * offset_s,
            y_m=columns[1] + columns[4] * offset_s,
            heading_rad=columns[2],
            vx_mps=columns[3],
            vy_mps=columns[4],
            speed_mps=np.hypot(columns[3], columns[4]),
            lateral_mps=np.zeros(n),
            accel_mps2=np.zeros(n),
            length_m=np.array([LENGTH_M if k is CAR else 0.5 for k in kinds]),
            width_m=np.array([WIDTH_M if k is CAR else 0.5 for k in kinds]),
            signal=Signal.NONE,
            stop_line_m=math.inf,
        )

    return at(-share * step_s), at((1 - share) * step_s)


def contact_of(before: Frame | None, frame: Frame) -> Contact | None:
    return find_contact(before, frame, relative_view(frame))


def ego(speed_mps: float = 10.0, lateral_mps: float = 0.0) -> Actor:
    return (0.0, 0.0, 0.0, speed_mps, lateral_mps, CAR)


CLEAN = History(
    started_s=START_S,
    teleported=False,
    spawn_overlap=False,
    inside_limits=True,
    touched_before=False,
    visible_for_s=3.0,
    ever_visible=True,
)


def broken(pair: tuple[Frame, Frame], history: History = CLEAN) -> set[str]:
    """The rules that the first contact between two frames fails."""
    contact = contact_of(*pair)
    assert contact is not None
    return {rule for rule, passed in verdicts(contact, pair[1], history).items() if not passed}


# At the given instant the bodies touch with no overlap, so that places can be read off the numbers.
INTO_LEADER = (ego(15.0), (LENGTH_M, 0.0, 0.0, 5.0, 0.0, CAR))
FROM_BEHIND = (ego(5.0), (-LENGTH_M, 0.0, 0.0, 15.0, 0.0, CAR))
SIDESWIPE = (ego(10.0), (-0.5, WIDTH_M, 0.0, 10.0, -1.5, CAR))  # contact from 2.8 m behind the front bumper
CUT_IN = (ego(10.0), (LENGTH_M - 0.5, WIDTH_M, 0.0, 9.0, -1.5, CAR))  # its rear right corner, 0.5 m from the bumper
EGO_DRIFTS = (ego(10.0, 1.5), (-0.5, WIDTH_M, 0.0, 10.0, 0.0, CAR))
# From the right, its front into the ego's flank 2.3 m behind the bumper.
CROSSING = (ego(8.0), (0.0, -(WIDTH_M + LENGTH_M) / 2, math.pi / 2, 0.0, 12.0, CAR))
INTO_CROSSING = (ego(12.0), ((LENGTH_M + WIDTH_M) / 2, 0.0, math.pi / 2, 0.0, 8.0, CAR))
HEAD_ON = (ego(10.0), (LENGTH_M, 0.3, math.pi, -10.0, 0.0, CAR))
INTO_WALKER = (ego(10.0), (LENGTH_M / 2 + 0.25, 0.2, math.pi / 2, 0.0, 1.5, WALKER))
WALKER_INTO_FLANK = (ego(10.0), (-1.0, -WIDTH_M / 2 - 0.25, math.pi / 2, 0.0, 1.5, WALKER))


@pytest.mark.parametrize(
    ("actors", "rules"),
    [
        pytest.param(INTO_LEADER, set(), id="the ego runs into its leader"),
        pytest.param(HEAD_ON, set(), id="head-on"),
        pytest.param(CUT_IN, set(), id="a cut-in onto the front corner"),
        pytest.param(INTO_CROSSING, set(), id="the ego hits crossing traffic"),
        pytest.param(CROSSING, set(), id="crossing traffic, long visible, hits the flank"),
        pytest.param(INTO_WALKER, set(), id="the ego runs over a pedestrian"),
        pytest.param(FROM_BEHIND, {"not_from_behind"}, id="struck from behind"),
        pytest.param(SIDESWIPE, {"no_sideswipe"}, id="sideswiped on the flank"),
        pytest.param(EGO_DRIFTS, set(), id="the ego itself drifts into its neighbour"),
        pytest.param(WALKER_INTO_FLANK, {"no_sideswipe"}, id="a pedestrian walks into the flank"),
    ],
)
def test_geometry_alone_decides_the_degenerate_contacts(actors: tuple[Actor, ...], rules: set[str]) -> None:
    assert broken(frames(*actors)) == rules


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize(("behind_front_m", "rules"), [(1.4, set()), (1.6, {"no_sideswipe"})])
def test_a_flank_contact_is_a_sideswipe_from_one_and_a_half_metres_behind_the_front_bumper(
    mirror: int, behind_front_m: float, rules: set[str]
) -> None:
    # A pointed contact: the neighbour stands 12 degrees across and its front corner comes first.
    yaw = -0.2 * mirror
    corner_x = LENGTH_M / 2 * math.cos(yaw) - WIDTH_M / 2 * abs(math.sin(yaw))
    corner_y = LENGTH_M / 2 * abs(math.sin(yaw)) + WIDTH_M / 2 * math.cos(yaw)
    x = LENGTH_M / 2 - behind_front_m - corner_x
    actors = (ego(10.0), (x, mirror * (WIDTH_M / 2 + corner_y), yaw, 10.0, -2.0 * mirror, CAR))
    contact = contact_of(*frames(*actors))
    assert contact is not None
    assert contact.x_m == pytest.approx(LENGTH_M / 2 - behind_front_m, abs=0.01)
    assert contact.ego_zone == ("left" if mirror == 1 else "right")
    assert broken(frames(*actors)) == rules


@pytest.mark.parametrize(("visible_for_s", "rules"), [(1.0, set()), (3.0, set()), (0.9, {"no_sideswipe"})])
def test_a_crossing_hit_on_the_flank_counts_if_it_was_visible_for_a_second(
    visible_for_s: float, rules: set[str]
) -> None:
    assert broken(frames(*CROSSING), replace(CLEAN, visible_for_s=visible_for_s)) == rules


@pytest.mark.parametrize(("angle_deg", "rules"), [(25.0, {"no_sideswipe"}), (35.0, set())])
def test_a_crossing_conflict_takes_headings_30_degrees_apart(angle_deg: float, rules: set[str]) -> None:
    yaw = math.radians(angle_deg)
    reach = LENGTH_M / 2 * math.sin(yaw) + WIDTH_M / 2 * math.cos(yaw)
    corner_x = LENGTH_M / 2 * math.cos(yaw) - WIDTH_M / 2 * math.sin(yaw)
    x = -1.0 - corner_x
    actors = (ego(8.0), (x, -WIDTH_M / 2 - reach, yaw, 10 * math.cos(yaw), 10 * math.sin(yaw), CAR))
    assert broken(frames(*actors)) == rules


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"teleported": True}, "no_teleport"),
        ({"spawn_overlap": True}, "no_spawn_overlap"),
        ({"inside_limits": False}, "inside_limits"),
        ({"touched_before": True}, "solid_bodies"),
        ({"ever_visible": False}, "seen_before"),
    ],
)
def test_each_fact_of_the_history_breaks_its_own_rule(change: dict[str, bool], rule: str) -> None:
    assert broken(frames(*INTO_LEADER), replace(CLEAN, **change)) == {rule}


def test_a_pedestrian_that_stepped_out_just_before_is_fine() -> None:
    assert broken(frames(*INTO_WALKER), replace(CLEAN, visible_for_s=0.1)) == set()


@pytest.mark.parametrize(("speed_mps", "rules"), [(0.0, {"ego_moving"}), (0.49, {"ego_moving"}), (0.51, set())])
def test_a_standing_ego_has_no_part_in_its_collision(speed_mps: float, rules: set[str]) -> None:
    assert broken(frames(ego(speed_mps), (LENGTH_M, 0.0, math.pi, -10.0, 0.0, CAR))) == rules


@pytest.mark.parametrize(("after_s", "rules"), [(0.95, {"after_first_second"}), (1.05, set())])
def test_the_first_second_does_not_count(after_s: float, rules: set[str]) -> None:
    assert broken(frames(*INTO_LEADER, time_s=START_S + after_s)) == rules


def test_artefact_rules_are_verdicts_that_blame_nobody() -> None:
    contact = contact_of(*frames(*INTO_LEADER))
    assert contact is not None
    named = set(verdicts(contact, frames(*INTO_LEADER)[1], CLEAN))
    assert named - ARTEFACT_RULES == {"not_from_behind", "ego_moving", "no_sideswipe", "seen_before"}
    assert named > ARTEFACT_RULES


def test_every_broken_rule_is_named() -> None:
    history = replace(CLEAN, touched_before=True, ever_visible=False)
    assert broken(frames(*FROM_BEHIND), history) == {"not_from_behind", "solid_bodies", "seen_before"}


@pytest.mark.parametrize(
    ("actors", "ego_zone", "other_zone", "x_m", "y_m"),
    [
        (INTO_LEADER, "front", "rear", 2.3, 0.0),
        (FROM_BEHIND, "rear", "front", -2.3, 0.0),
        (SIDESWIPE, "left", "right", -0.25, 0.925),  # the sides share the stretch from -2.3 to 1.8
        (HEAD_ON, "front", "front", 2.3, 0.15),
        (CROSSING, "right", "front", 0.0, -0.925),
        (INTO_CROSSING, "front", "left", 2.3, 0.0),
        (INTO_WALKER, "front", "left", 2.3, 0.2),
    ],
)
def test_the_contact_lies_where_the_bodies_met(
    actors: tuple[Actor, ...], ego_zone: str, other_zone: str, x_m: float, y_m: float
) -> None:
    contact = contact_of(*frames(*actors))
    assert contact is not None
    assert (contact.ego_zone, contact.other_zone) == (ego_zone, other_zone)
    assert (contact.x_m, contact.y_m) == pytest.approx((x_m, y_m), abs=0.03)


def test_relative_motion_at_the_contact() -> None:
    contact = contact_of(*frames(*CROSSING))
    assert contact is not None
    assert contact.relative_speed_mps == pytest.approx(math.hypot(8, 12))
    assert contact.closing_lateral_other_mps == pytest.approx(12.0)
    assert contact.closing_lateral_ego_mps == pytest.approx(0.0)
    assert contact.heading_sin == pytest.approx(1.0)
    assert contact.lateral_offset_m == pytest.approx(-(WIDTH_M + LENGTH_M) / 2, abs=0.02)


@pytest.mark.parametrize("actors", [INTO_LEADER, CUT_IN, SIDESWIPE, CROSSING, INTO_WALKER])
@pytest.mark.parametrize("step_s", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_time_and_place_do_not_depend_on_the_step(actors: tuple[Actor, ...], step_s: float, share: float) -> None:
    fine = contact_of(*frames(*actors, step_s=0.001))
    contact = contact_of(*frames(*actors, step_s=step_s, share=share))
    assert fine is not None
    assert contact is not None
    assert contact.time_s == pytest.approx(5.0, abs=0.001)
    assert (contact.x_m, contact.y_m) == pytest.approx((fine.x_m, fine.y_m), abs=0.03)
    assert (contact.ego_zone, contact.other_zone) == (fine.ego_zone, fine.other_zone)


def test_of_two_contacts_in_a_step_the_earlier_one_is_reported() -> None:
    late = (LENGTH_M + 0.2, -1.0, 0.0, 0.0, 0.0, CAR)  # reached 20 ms after the other
    early = (LENGTH_M / 2 + 0.25, 0.7, 0.0, 0.0, 0.0, WALKER)
    contact = contact_of(*frames(ego(10.0), late, early))
    assert contact is not None
    assert contact.other == 2
    assert contact.time_s == pytest.approx(5.0, abs=0.001)


def test_bodies_apart_make_no_contact() -> None:
    assert contact_of(*frames(ego(10.0), (LENGTH_M + 5, 0.0, 0.0, 0.0, 0.0, CAR))) is None


def test_a_near_miss_is_no_contact() -> None:
    assert contact_of(*frames(ego(15.0), (0.0, WIDTH_M + 0.01, 0.0, 5.0, 0.0, CAR))) is None


def test_the_first_frame_of_an_episode_has_no_step_to_look_back_on() -> None:
    _, frame = frames(*INTO_LEADER)
    contact = contact_of(None, frame)
    assert contact is not None
    assert contact.time_s == frame.time_s


def test_a_contact_is_found_when_another_actor_has_just_left() -> None:
    before, _ = frames(*INTO_LEADER, (500.0, 0.0, 0.0, 10.0, 0.0, CAR))
    _, frame = frames(*INTO_LEADER)
    contact = contact_of(before, frame)
    assert contact is not None
    assert contact.other == 1


def test_headings_that_pass_south_are_interpolated_the_short_way() -> None:
    before, frame = frames(ego(10.0), (LENGTH_M, 0.0, math.pi, -10.0, 0.0, CAR))
    before = replace(before, heading_rad=np.array([0.0, -math.pi + 0.01]))
    contact = contact_of(before, frame)
    assert contact is not None
    assert contact.time_s == pytest.approx(5.0, abs=0.005)
    assert contact.ego_zone == "front"


def test_sumo_agrees_when_it_names_the_pair_in_either_order() -> None:
    _, frame = frames(*INTO_LEADER)
    assert not agrees(frame, "ego", "lead")
    assert agrees(replace(frame, simulator_collisions=(("lead", "ego"),)), "ego", "lead")
    assert agrees(replace(frame, simulator_collisions=(("a", "b"), ("ego", "lead"))), "ego", "lead")
    assert not agrees(replace(frame, simulator_collisions=(("ego", "left"),)), "ego", "lead")
