from itertools import pairwise
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config import Behaviour, DynamicElements, Environment, Interval, Odd, Scenery
from risk_sac.errors import OddError
from risk_sac.risk.requirements import SHIPPED_REQUIREMENTS, requirements_from_odd
from risk_sac.risk.stl import Monitor
from risk_sac.scenario.limits import BOUNDS, behaving, limits_from_odd, preset
from risk_sac.scenario.odd import intersect


def interval(low: float, high: float) -> Interval:
    return Interval(low=low, high=high)


DEFAULT = Odd(
    scenery=Scenery(
        lanes=interval(2, 3),
        speed_limit_mps=interval(8, 16),
        signal_types=("fixed_time", "none"),
        crossing_types=("none", "zebra"),
    ),
    environment=Environment(
        friction=interval(0.5, 1.0), visibility_m=interval(100, 2000), precipitation=("none",), time_of_day=("day",)
    ),
    dynamic=DynamicElements(
        actor_kinds=("pedestrian", "vehicle"),
        ego_speed_mps=interval(0, 15),
        vehicle_speed_mps=interval(0, 20),
        **preset("ordinary"),
    ),
)


def test_intersection_narrows_the_given_fields_and_keeps_the_rest():
    assert intersect(DEFAULT, Odd()) == DEFAULT
    user = Odd(scenery=Scenery(signal_types=("none",)), dynamic=DynamicElements(vehicle_speed_mps=interval(10, 30)))
    both = intersect(DEFAULT, user)
    assert both.dynamic.vehicle_speed_mps == interval(10, 20)
    assert both.scenery.signal_types == ("none",)
    assert both.environment == DEFAULT.environment
    assert both.dynamic.actor_kinds == DEFAULT.dynamic.actor_kinds


SPEED = st.just(0.0) | st.floats(1e-6, 60)


@given(st.tuples(SPEED, SPEED).map(sorted))
def test_intersection_is_the_set_of_common_values(bounds):
    low, high = bounds
    user = Odd(dynamic=DynamicElements(vehicle_speed_mps=interval(low, high)))
    if low > 20:
        with pytest.raises(OddError, match="vehicle_speed_mps"):
            intersect(DEFAULT, user)
    else:
        assert intersect(DEFAULT, user).dynamic.vehicle_speed_mps == interval(low, min(high, 20))


@pytest.mark.parametrize("behaviour", get_args(Behaviour))
def test_a_behaviour_sets_the_limits_that_the_user_leaves_out(behaviour):
    stated = DynamicElements(behaviour=behaviour, vehicle_accel_mps2=interval(-6, 3))
    both = intersect(DEFAULT, Odd(dynamic=stated)).dynamic
    assert both.behaviour == behaviour
    assert both.vehicle_accel_mps2 == interval(-6, 3)  # beyond the ordinary -4 to 2
    for field in BOUNDS.keys() - {"vehicle_accel_mps2"}:
        assert getattr(both, field) == preset(behaviour)[field]


def test_each_behaviour_contains_the_one_before_it():
    for bounds in BOUNDS.values():
        for narrow, wide in pairwise((bounds.ordinary, bounds.emergency, bounds.extreme)):
            assert wide[0] <= narrow[0] <= narrow[1] <= wide[1]


def test_emergency_limits_of_a_dry_road():
    limits = limits_from_odd(intersect(DEFAULT, Odd(dynamic=DynamicElements(behaviour="emergency"))), 1.0)
    assert (limits.brake_mps2, limits.accel_mps2, limits.jerk_mps3) == (8.0, 3.5, 20.0)
    assert (limits.lateral_mps, limits.lateral_accel_mps2) == (1.2, 1.5)
    assert (limits.walk_speed_mps, limits.walk_disc_mps2, limits.heading_rate_radps) == (2.0, 1.5, 2.0)


@pytest.mark.parametrize(
    ("part", "field", "value"),
    [
        ("dynamic", "vehicle_speed_mps", interval(25, 30)),
        ("dynamic", "ego_speed_mps", interval(-1, 10)),
        ("dynamic", "vehicle_accel_mps2", interval(1, 3)),  # no braking
        ("dynamic", "vehicle_lateral_speed_mps", interval(0, 1.9)),
        ("dynamic", "vehicle_lateral_accel_mps2", interval(0, 0)),
        ("dynamic", "vehicle_jerk_mps3", interval(0, 0.5)),
        ("dynamic", "vehicle_jerk_mps3", interval(2, 10)),
        ("dynamic", "pedestrian_turn_radps", interval(0, 0)),
        ("scenery", "crossing_types", ("signalised",)),
        ("scenery", "signal_types", ()),
        ("scenery", "lanes", interval(0, 2)),
        ("environment", "friction", interval(0, 1)),
        ("environment", "visibility_m", interval(10, 30)),
    ],
)
def test_a_bad_odd_is_refused_by_its_field(part, field, value):
    with pytest.raises(OddError) as caught:
        intersect(DEFAULT, Odd.model_validate({part: {field: value}}))
    assert caught.value.field == f"odd.{part}.{field}"


def test_a_bad_odd_says_what_it_got_and_what_is_wanted():
    with pytest.raises(OddError, match=r"got \[0.8, 1\]; wanted an overlap with \[0.5, 0.65\], the friction in rain"):
        intersect(DEFAULT, Odd(environment=Environment(precipitation=("rain",), friction=interval(0.8, 1))))


@pytest.mark.parametrize(
    ("environment", "friction"),
    [
        (Environment(), (0.5, 1.0)),
        (Environment(friction=interval(0.1, 0.7)), (0.4, 0.7)),
        (Environment(precipitation=("none",)), (0.5, 1.0)),
        (Environment(precipitation=("rain",)), (0.5, 0.65)),
        (Environment(precipitation=("none", "heavy_rain")), (0.4, 1.0)),
        (Environment(precipitation=("rain", "heavy_rain"), friction=interval(0.5, 0.6)), (0.5, 0.6)),
    ],
)
def test_rain_bounds_the_friction(environment, friction):
    assert intersect(DEFAULT, Odd(environment=environment)).environment.friction == interval(*friction)


@pytest.mark.parametrize(
    ("signals", "crossings"),
    [(("none",), ("zebra",)), (("fixed_time",), ("signalised",)), (None, ("signalised", "zebra"))],
)
def test_crossings_keep_to_the_signals(signals, crossings):
    both = Scenery(signal_types=("fixed_time", "none"), crossing_types=("signalised", "zebra"))
    default = DEFAULT.model_copy(update={"scenery": both})
    assert intersect(default, Odd(scenery=Scenery(signal_types=signals))).scenery.crossing_types == crossings


def test_requirements_follow_the_odd():
    everything = {r.name for r in requirements_from_odd(DEFAULT, 0.5)}
    assert everything == {
        "no_contact",
        "safe_ttc",
        "rss_margin",
        "on_carriageway",
        "pedestrian_gap",
        "no_red_light_entry",
        "bounded_braking",
    }
    assert everything == set(SHIPPED_REQUIREMENTS)
    motorway = Odd(scenery=Scenery(signal_types=("none",)), dynamic=DynamicElements(actor_kinds=("vehicle",)))
    left_out = everything - {r.name for r in requirements_from_odd(intersect(DEFAULT, motorway), 0.5)}
    assert left_out == {"pedestrian_gap", "no_red_light_entry"}
    counting = {r.name for r in requirements_from_odd(DEFAULT, 0.5) if r.counts == "failure"}
    assert counting == {"no_contact", "on_carriageway", "no_red_light_entry"}


def test_thresholds_follow_the_odd_and_the_reaction_time():
    slow = {r.name: r.formula for r in requirements_from_odd(DEFAULT, 1.2)}
    assert slow["safe_ttc"] == "encounter_s >= 2.2"
    # 0.5 · 9.81, and nine tenths of it
    assert slow["no_red_light_entry"] == "historically[0,1] (red_light_braking_mps2 <= 4.91)"
    assert slow["bounded_braking"] == "not historically[0,0.5] (ego_braking_mps2 >= 4.42)"
    dry = intersect(DEFAULT, Odd(environment=Environment(friction=interval(1.0, 1.0))))
    quick = {r.name: r.formula for r in requirements_from_odd(dry, 0.1)}
    assert quick["safe_ttc"] == "encounter_s >= 1.5"
    assert quick["bounded_braking"].endswith(">= 8.1)")  # 0.9 · min(9.81, 9)


def test_an_ego_that_nobody_threatens_has_a_robustness_of_about_1_in_every_requirement():
    requirements = requirements_from_odd(DEFAULT, 0.5)
    monitor = Monitor(requirements, 0.1, 150)
    calm = {"encounter_s": 4.2, "rss_margin": 1.0, "pedestrian_gap_m": 12.0, "red_light_braking_mps2": 0.0}
    calm |= {"vehicle_gap_m": 10.0, "carriageway_m": 1.65}  # on a road of one lane
    for speed_mps in (0.0, 5.0):
        monitor.reset()
        robustness = monitor.update(calm | {"ego_speed_mps": speed_mps, "ego_braking_mps2": 0.0})
        assert robustness == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(("gap_m", "speed_mps"), [(2.0, 13.9), (3.0, 16.6), (1.1, 5.0), (0.0, 0.4)])
def test_passing_a_pedestrian_on_the_sidewalk_or_standing_beside_one_violates_nothing(gap_m, speed_mps):
    [requirement] = [r for r in requirements_from_odd(DEFAULT, 0.5) if r.name == "pedestrian_gap"]
    monitor = Monitor([requirement], 0.1, 150)
    assert monitor.update({"pedestrian_gap_m": gap_m, "ego_speed_mps": speed_mps})[0] > 0
    assert monitor.update({"pedestrian_gap_m": 0.4, "ego_speed_mps": max(speed_mps, 1.0)})[0] < 0


@pytest.mark.parametrize(
    ("own", "asked", "wider"), [("emergency", "ordinary", "emergency"), ("ordinary", "extreme", "extreme")]
)
def test_of_a_scenarios_behaviour_and_a_campaigns_the_wider_counts(own, asked, wider):
    default = DEFAULT.model_copy(update={"dynamic": behaving(DEFAULT.dynamic, own)})
    both = intersect(default, Odd(dynamic=DynamicElements(behaviour=asked)))
    assert both.dynamic.behaviour == wider
    assert both.dynamic.vehicle_accel_mps2 == preset(wider)["vehicle_accel_mps2"]
