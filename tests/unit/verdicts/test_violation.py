"""Violations without contact: records and preventing reference drivers, also mirrored."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.config import Requirement
from risk_sac.maps.carriageway import Carriageway
from risk_sac.records import Fault, Grade, Violation
from risk_sac.risk.measures import Gauge
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.verdicts.evidence import PER_ACTOR, Evidence
from risk_sac.verdicts.judge import requirement_results, violations_of
from risk_sac.verdicts.reference import History
from risk_sac.world.types import Kind, Signal
from tests.builders import frame_of
from tests.unit.verdicts.staged import CAR_M, WALKING, Motion, mirrored, sideways, stage, straight


def own(formula: str, name: str = "own") -> Requirement:
    return Requirement(name=name, formula=formula, scale=1.0)


def staged(*motions: Motion, kinds: tuple[Kind, ...] = (Kind.VEHICLE, Kind.VEHICLE), until_s: float = 8.0) -> Evidence:
    return stage(*motions, kinds=kinds, until_s=until_s, contact=False)


def played(
    evidence: Evidence,
    requirement: Requirement,
    signals: list[tuple[Signal, float]] | None = None,
    artefacts: Mapping[str, float] | None = None,
) -> list[Violation]:
    e = evidence
    frames, measures = [], []
    gauge = Gauge((requirement,), 1000, RssParameters(), 20.0)
    gauge.reset(Carriageway())
    for t, time_s in enumerate(e.time_s.tolist()):
        signal, stop_line_m = signals[t] if signals else (Signal.NONE, np.inf)
        rows = {name: getattr(e, name)[t] for name in PER_ACTOR} | {"length_m": e.length_m, "width_m": e.width_m}
        link = e.link[t].astype(np.uint8).tolist()
        frame = frame_of(
            e.kind.tolist(), time_s=time_s, ids=e.ids, signal=signal, stop_line_m=stop_line_m, link=link, **rows
        )
        frame = frame._replace(role=e.role)
        measures.append(gauge.measure(frame, frames[-1] if frames else None, e.known[t, 1:]))
        frames.append(frame)
    released = int(np.searchsorted(e.time_s, -1e-6))
    results = requirement_results((requirement,), e.time_s[released:].tolist(), measures[released:], None)
    return list(violations_of((requirement,), results, lambda: History(frames, measures, e), gauge, artefacts or {}))


def violated(
    evidence: Evidence, requirement: Requirement, signals: list[tuple[Signal, float]] | None = None
) -> Violation:
    [first], [second] = (played(each, requirement, signals) for each in (evidence, mirrored(evidence)))
    assert second == first
    return first


def closes_in(gap_m: float = 25.0, late_s: float = 2.0, *others: Motion) -> Evidence:
    """A leader brakes at 1 s, the ego `late_s` after it."""
    ego = straight(0.0, 0.0, 0.0, 14.0, (1.0 + late_s, -8.0))
    leader = straight(CAR_M[0] + gap_m, 0.0, 0.0, 14.0, (1.0, -6.5))
    return staged(ego, leader, *others, kinds=(Kind.VEHICLE,) * (2 + len(others)))


KEEPS_APART = own("vehicle_gap_m >= 4")


def test_a_careful_driver_keeps_a_distance_that_the_ego_did_not():
    found = violated(closes_in(), KEEPS_APART)
    assert found.grade is Grade.PREVENTABLE
    assert set(found.drivers) == {"r157", "fsm", "rss", "defensive", "full_braking"}
    assert (found.other_id, found.other_kind, found.other_role) == ("actor_1", "vehicle", "adversary")
    assert (found.kind, found.variant) == ("own violated; ego goes straight", "ego slow")
    assert found.time_s == pytest.approx(3.75, abs=0.15)  # it stands 10 m ahead at 3.15 s
    assert found.robustness < 0.0
    assert (found.broke, found.hidden, found.valid, found.fault) == ((), False, True, Fault.SHARED)  # a brake check


def test_a_distance_that_nobody_could_keep_is_unavoidable():
    found = violated(closes_in(gap_m=4.2), KEEPS_APART)
    assert (found.grade, found.fault) == (Grade.UNAVOIDABLE, Fault.EGO)  # a follower has to keep its distance


def test_an_ego_that_passes_a_pedestrian_too_closely_would_have_had_room_in_its_lane():
    swerves = sideways(straight(0.0, 0.0, 0.0, 10.0), 2.0, 1.0, 2.0)
    evidence = staged(swerves, straight(60.0, 4.2, 0.0, 0.0), kinds=WALKING)
    found = violated(evidence, own("pedestrian_gap_m >= 1.5"))
    assert (found.grade, found.ego_manoeuvre) == (Grade.PREVENTABLE, "lane_change")
    straight_on = staged(
        sideways(straight(0.0, 0.0, 0.0, 10.0), -1.5, 2.0, 2.0), straight(60.0, 4.2, 0.0, 0.0), kinds=WALKING
    )
    assert violated(straight_on, own("pedestrian_gap_m >= 1.5")).grade is Grade.UNAVOIDABLE


def to_line(evidence: Evidence, line_m: float, yellow_m: float, red_m: float) -> list[tuple[Signal, float]]:
    """Signal that turns yellow and red at distances from its line."""
    ahead = line_m - evidence.x_m[:, 0] - CAR_M[0] / 2
    return [
        (Signal.NONE, np.inf)
        if d < 0.0
        else (Signal.RED if d <= red_m else Signal.YELLOW if d <= yellow_m else Signal.GREEN, float(d))
        for d in ahead
    ]


NO_RED = own("historically[0,1] (red_light_braking_mps2 <= 9)", "no_red_light_entry")


@pytest.mark.parametrize(
    ("yellow_m", "red_m", "grade"),
    [
        (200.0, 200.0, Grade.PREVENTABLE),
        (40.0, 10.0, Grade.PREVENTABLE),
        (26.0, 26.0, Grade.PREVENTABLE),  # 12 m/s: 13.8 m in 1.15 s, then 0.6 s to 7.6 m/s², about 12 m more
        (15.0, 15.0, Grade.FULL_BRAKING),  # 12² / (2 · 8) = 9 m
        (8.0, 8.0, Grade.UNAVOIDABLE),
    ],
)
def test_a_reference_driver_stops_at_red_where_it_can(yellow_m, red_m, grade):
    evidence = staged(straight(0.0, 0.0, 0.0, 12.0), straight(500.0, 0.0, 0.0, 12.0))
    shown = to_line(evidence, 60.0, yellow_m, red_m)
    link = np.zeros_like(evidence.link)
    link[:, 0] = [ord("r") if signal is Signal.RED else 0 for signal, _ in shown]
    found = violated(replace(evidence, link=link), NO_RED, shown)
    assert found.grade is grade
    assert found.kind == "red light entered; ego goes straight"
    assert found.broke == ("red_light",)
    assert found.fault is (Fault.EGO if grade is Grade.PREVENTABLE else Fault.OTHER)


@pytest.mark.parametrize(("red_m", "valid"), [(38.0, True), (25.0, False)])
def test_a_red_light_that_the_ego_could_not_stop_at_when_it_was_handed_over_is_inherited(red_m, valid):
    """It takes 30 m at 12 m/s to stop at leisure."""
    ego, far = straight(0.0, 0.0, 0.0, 12.0), straight(500.0, 0.0, 0.0, 12.0)
    evidence = staged(ego, far)
    shown = to_line(evidence, 1.5 * 12.0 + CAR_M[0] / 2 + red_m, 200.0, 200.0)
    found = violated(evidence, NO_RED, shown)
    assert (found.valid, found.verdicts["conflict_after_release"]) == (valid, valid)
    assert (found.other_id, found.grade) == (None, Grade.PREVENTABLE if valid else None)


def test_an_ego_that_stops_at_an_inherited_red_light_and_then_creeps_over_the_line_enters_by_itself():
    ego = straight(0.0, 0.0, 0.0, 12.0, (0.0, -4.0), (6.0, 1.0))  # it stands after 18 m, from 3 s to 6 s
    evidence = staged(ego, straight(500.0, 0.0, 0.0, 12.0))
    shown = to_line(evidence, 1.5 * 12.0 + CAR_M[0] / 2 + 19.0, 19.0, 19.0)
    found = violated(evidence, NO_RED, shown)
    assert found.time_s > 6.0
    assert (found.valid, found.grade, found.fault) == (True, Grade.PREVENTABLE, Fault.EGO)


SLOW = own("ego_speed_mps <= 10")


@pytest.mark.parametrize(
    ("changes", "valid", "time_s"),
    [
        (((0.0, -2.0),), False, 0.0),  # it slows down at once
        (((0.0, -2.0), (3.0, 2.0)), True, 5.0),  # at 3 s it has 6 m/s, and speeds up again
        ((), True, 5.0),  # it never slows down
    ],
)
def test_a_speed_that_was_inherited_counts_once_it_is_the_egos_own(changes, valid, time_s):
    found = violated(staged(straight(0.0, 0.0, 0.0, 12.0, *changes), straight(500.0, 0.0, 0.0, 12.0)), SLOW)
    assert (found.valid, found.other_id) == (valid, None)
    assert found.time_s == pytest.approx(time_s, abs=0.2)
