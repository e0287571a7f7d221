import contextlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from risk_sac.config import DynamicElements, Environment, Interval, Odd, Requirement, Scenery
from risk_sac.errors import FormulaError, NotFinite
from risk_sac.risk.formula import parse
from risk_sac.risk.measures import soft_min
from risk_sac.risk.requirements import SIGNALS, requirements_from_odd
from risk_sac.risk.stl import Monitor

STEP_S, HORIZON = 0.1, 150
ODD = Odd(
    scenery=Scenery(signal_types=("fixed_time",)),
    environment=Environment(friction=Interval(low=0.6, high=1.0)),
    dynamic=DynamicElements(actor_kinds=("pedestrian", "vehicle")),
)
SHIPPED = requirements_from_odd(ODD, 0.5)

Traces = Mapping[str, np.ndarray]  # signal -> traces x steps


def requirement(formula: str, scale: float = 1.0) -> Requirement:
    return Requirement(name="mine", formula=formula, scale=scale)


def monitor(*formulas: str, scale: float = 1.0, horizon_steps: int = HORIZON) -> Monitor:
    return Monitor([requirement(formula, scale) for formula in formulas], STEP_S, horizon_steps)


def at_rest() -> dict[str, float]:
    return {name: info.high for name, info in SIGNALS.items()}


# An oracle that shares nothing with the code: whole traces, straight from the definition of robustness.


def oracle(formula: Any, traces: Traces) -> np.ndarray:
    """Computes robustness, traces x steps, of a signal, number, or (operator, operands...)."""
    shape = next(iter(traces.values())).shape
    if isinstance(formula, str):
        return traces[formula]
    if isinstance(formula, int | float):
        return np.full(shape, float(formula))
    operator, *operands = formula
    if operator in ("historically", "once"):
        (first, last), child = operands
        worst, best = (np.min, math.inf) if operator == "historically" else (np.max, -math.inf)
        x = oracle(child, traces)
        return over_time(shape, first, last, lambda past, t: worst(x[:, past], axis=1), best)
    if operator == "since":
        (first, last), left, right = operands
        p, q = oracle(left, traces), oracle(right, traces)

        def strongest(past: list[int], t: int) -> np.ndarray:
            return np.max(
                [np.minimum(q[:, k], p[:, k + 1 : t + 1].min(axis=1, initial=math.inf)) for k in past], axis=0
            )

        return over_time(shape, first, last, strongest, -math.inf)
    if operator == "prev":
        x = oracle(operands[0], traces)
        return np.concatenate([np.full((len(x), 1), math.inf), x[:, :-1]], axis=1)
    values = [oracle(operand, traces) for operand in operands]
    return POINTWISE[operator](*values)


def over_time(shape: tuple[int, ...], first: int, last: float, of: Any, when_empty: float) -> np.ndarray:
    result = np.full(shape, when_empty)
    for t in range(shape[1]):
        past = [k for k in range(t + 1) if t - last <= k <= t - first]
        if past:
            result[:, t] = of(past, t)
    return result


POINTWISE = {
    "not": np.negative,
    "and": np.minimum,
    "or": np.maximum,
    "implies": lambda p, q: np.maximum(-p, q),
    ">=": np.subtract,
    ">": np.subtract,
    "<=": lambda a, b: b - a,
    "<": lambda a, b: b - a,
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "abs": np.abs,
}
ALL = (0, math.inf)
NEAR, SLOW = ("<=", "vehicle_gap_m", 10), ("<=", "ego_speed_mps", 5)
FORMULAS: dict[str, Any] = {
    "ttc_s >= 1.5": (">=", "ttc_s", 1.5),
    "historically[0,0.5](ttc_s >= 1.5)": ("historically", (0, 5), (">=", "ttc_s", 1.5)),
    "H[200ms:1.2s] ttc_s > 2": ("historically", (2, 12), (">", "ttc_s", 2)),
    "once[0.3,0.7] ego_speed_mps < 5": ("once", (3, 7), ("<", "ego_speed_mps", 5)),
    "historically vehicle_gap_m <= 10": ("historically", ALL, NEAR),
    "once(vehicle_gap_m <= 10)": ("once", ALL, NEAR),
    "vehicle_gap_m <= 10 since ego_speed_mps <= 5": ("since", ALL, NEAR, SLOW),
    "(vehicle_gap_m <= 10) since[0.2,1] (ego_speed_mps <= 5)": ("since", (2, 10), NEAR, SLOW),
    "not prev ego_speed_mps <= 5": ("not", ("prev", SLOW)),
    # precedence: and over or over implies, implies to the right, temporal operators over and
    "ttc_s >= 1 or vehicle_gap_m <= 10 and ego_speed_mps <= 5": ("or", (">=", "ttc_s", 1), ("and", NEAR, SLOW)),
    "vehicle_gap_m <= 10 -> ego_speed_mps <= 5 -> ttc_s >= 1": ("implies", NEAR, ("implies", SLOW, (">=", "ttc_s", 1))),
    "not vehicle_gap_m <= 10 & ego_speed_mps <= 5": ("and", ("not", NEAR), SLOW),
    "once[0,0.2] vehicle_gap_m <= 10 and ego_speed_mps <= 5": ("and", ("once", (0, 2), NEAR), SLOW),
    # arithmetic, to the left
    "vehicle_gap_m - ego_speed_mps + ttc_s >= 3": (">=", ("+", ("-", "vehicle_gap_m", "ego_speed_mps"), "ttc_s"), 3),
    "vehicle_gap_m/2*ttc_s - 1.5*ego_speed_mps >= -3": (
        ">=",
        ("-", ("*", ("/", "vehicle_gap_m", 2), "ttc_s"), ("*", 1.5, "ego_speed_mps")),
        -3,
    ),
    "abs(rss_margin - -1) * (2 + ttc_s) <= -(-1e1)": (
        "<=",
        ("*", ("abs", ("-", "rss_margin", -1)), ("+", 2, "ttc_s")),
        10,
    ),
    # the same timed sub-formula twice, and windows in windows: rtamt by itself gets the first one wrong
    "once[0,0.5](vehicle_gap_m <= 10) and (ttc_s >= 1 or not once[0,0.5](vehicle_gap_m <= 10))": (
        "and",
        ("once", (0, 5), NEAR),
        ("or", (">=", "ttc_s", 1), ("not", ("once", (0, 5), NEAR))),
    ),
    "historically[0,1](vehicle_gap_m <= 10 implies once[0.1,0.4](ego_speed_mps <= 5))": (
        "historically",
        (0, 10),
        ("implies", NEAR, ("once", (1, 4), SLOW)),
    ),
    "once[0,0.3] historically[0.1,0.3] not prev (vehicle_gap_m <= 10)": (
        "once",
        (0, 3),
        ("historically", (1, 3), ("not", ("prev", NEAR))),
    ),
}
SHIPPED_FORMULAS: dict[str, Any] = {
    "no_contact": ("and", (">=", "vehicle_gap_m", 0), (">=", "pedestrian_gap_m", 0)),
    "on_carriageway": (">=", "carriageway_m", 0),
    "safe_ttc": (">=", "encounter_s", 1.5),
    "rss_margin": (">=", "rss_margin", 0),
    "pedestrian_gap": (
        "or",
        (">=", "pedestrian_gap_m", ("+", 0.5, ("*", 0.1, "ego_speed_mps"))),
        ("<=", ("*", 20, "ego_speed_mps"), 10),
    ),
    "no_red_light_entry": ("historically", (0, 10), ("<=", "red_light_braking_mps2", 5.89)),
    "bounded_braking": ("not", ("historically", (0, 5), (">=", "ego_braking_mps2", 5.3))),
}


def random_traces(count: int, steps: int, seed: int) -> Traces:
    """Random walks through each signal's range that stick to its bounds."""
    rng = np.random.default_rng(seed)
    traces = {}
    for name, info in SIGNALS.items():
        width = info.high - info.low
        start = rng.uniform(info.low, info.high, (count, 1))
        walk = start + np.cumsum(rng.normal(0, 0.1 * width, (count, steps)), axis=1)
        traces[name] = np.clip(walk, info.low, info.high)
    return traces


def monitored(watched: Monitor, traces: Traces) -> np.ndarray:
    """Robustness, traces x steps x requirements."""
    count, steps = next(iter(traces.values())).shape
    columns = {name: values.tolist() for name, values in traces.items()}
    result = []
    for i in range(count):
        watched.reset()
        result.append([watched.update({name: rows[i][t] for name, rows in columns.items()}) for t in range(steps)])
    return np.array(result)


def test_shipped_requirements_agree_with_the_oracle_on_1000_random_traces():
    assert [r.name for r in SHIPPED] == list(SHIPPED_FORMULAS)
    traces = random_traces(1000, 40, seed=1)
    robustness = monitored(Monitor(SHIPPED, STEP_S, HORIZON), traces)
    for i, shipped in enumerate(SHIPPED):
        expected = np.clip(oracle(SHIPPED_FORMULAS[shipped.name], traces) / shipped.scale, -3, 3)
        np.testing.assert_allclose(robustness[:, :, i], expected, atol=1e-9, rtol=0, err_msg=shipped.name)


def test_user_formulas_agree_with_the_oracle_on_1000_random_traces():
    traces = random_traces(1000, 30, seed=2)
    robustness = monitored(monitor(*FORMULAS, scale=20.0), traces)
    for i, (text, formula) in enumerate(FORMULAS.items()):
        expected = np.clip(oracle(formula, traces) / 20.0, -3, 3)
        np.testing.assert_allclose(robustness[:, :, i], expected, atol=1e-9, rtol=0, err_msg=text)


leaves = st.sampled_from(sorted(SIGNALS)).flatmap(
    lambda s: st.tuples(st.sampled_from(["<=", ">="]), st.just(s), st.integers(-5, 30))
)
windows = st.tuples(st.integers(0, 5), st.integers(0, 5)).map(lambda w: (min(w), max(w)))
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from(["and", "or", "implies"]), inner, inner),
        st.tuples(st.sampled_from(["not", "prev"]), inner),
        st.tuples(st.sampled_from(["once", "historically"]), windows, inner),
        st.tuples(st.just("since"), windows, inner, inner),
    ),
    max_leaves=6,
)


def written(formula: Any) -> str:
    """A formula as a user would write it, window bounds in seconds."""
    operator, *operands = formula
    if operator in ("<=", ">="):
        return f"{operands[0]}{operator}{operands[1]}"
    window = ""
    if operator in ("once", "historically", "since"):
        (first, last), *operands = operands
        window = f"[{first / 10},{last / 10}]"
    left = f"({written(operands[0])})"
    return f"{operator}{window} {left}" if len(operands) == 1 else f"{left} {operator}{window} ({written(operands[1])})"


@given(trees.filter(lambda tree: len(written(tree)) <= 500), st.integers(0, 2**31))
def test_random_formulas_agree_with_the_oracle(tree, seed):
    traces = random_traces(2, 20, seed)
    expected = np.clip(oracle(tree, traces) / 20.0, -3, 3)
    np.testing.assert_allclose(monitored(monitor(written(tree), scale=20.0), traces)[:, :, 0], expected, atol=1e-9)


def test_half_a_second_is_five_samples_before_the_current_one():
    watched = monitor("historically[0,0.5](ttc_s >= 1.5)")
    trace = [0.5] + [2.0] * 7
    robustness = [watched.update(at_rest() | {"ttc_s": ttc_s})[0] for ttc_s in trace]
    assert robustness == [-1.0] * 6 + [0.5] * 2


def test_window_bounds_are_exact_multiples_of_the_step():
    assert parse("once[0.3,0.7](ttc_s >= 1)", 0.1, 100).window == (3, 7)  # 0.3 / 0.1 is 2.9999999999999996
    assert parse("once[0,0.5](ttc_s >= 1)", 0.05, 100).window == (0, 10)
    assert parse("once[100ms:1s](ttc_s >= 1)", 0.1, 100).window == (1, 10)


def test_reset_forgets_everything():
    watched, fresh = monitor(*FORMULAS, scale=20.0), monitor(*FORMULAS, scale=20.0)
    traces = random_traces(2, 30, seed=3)
    monitored(watched, traces)
    np.testing.assert_array_equal(monitored(watched, traces), monitored(fresh, traces))
    for _ in range(HORIZON):
        watched.update(dict.fromkeys(SIGNALS, 0.0))
    watched.reset()
    fresh.reset()
    np.testing.assert_array_equal(watched.update(at_rest()), fresh.update(at_rest()))


def test_equal_sub_formulas_of_two_requirements_are_both_right():
    watched = monitor("once[0,0.2](ttc_s <= 1)", "not once[0,0.2](ttc_s <= 1)")
    for ttc_s, expected in ((0.5, 0.5), (2.0, 0.5), (2.0, 0.5), (2.0, -1.0)):
        assert watched.update(at_rest() | {"ttc_s": ttc_s}).tolist() == [expected, -expected]


def test_robustness_is_scaled_and_clipped_and_warm_up_is_finite():
    watched = Monitor(
        [
            requirement("ttc_s >= 1", 4.0),
            requirement("vehicle_gap_m >= 1", 2.0),
            requirement("historically[1,2](ttc_s >= 1)"),
            requirement("once[1,2](ttc_s >= 1)"),
            requirement("prev ttc_s >= 1"),
        ],
        STEP_S,
        HORIZON,
    )
    assert watched.update(at_rest() | {"ttc_s": 3.0}).tolist() == [0.5, 3.0, 3.0, -3.0, 3.0]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_signal_that_is_not_finite_is_refused(value):
    with pytest.raises(NotFinite, match="'ttc_s'"):
        monitor("ttc_s >= 1").update(at_rest() | {"ttc_s": value})


GAP, TTC = "vehicle_gap_m >= 1", "ttc_s >= 1"
BAD: dict[str, int] = {  # formula: position of what is wrong
    "always(ttc_s >= 1)": 0,
    f"{TTC} until[0,1] {GAP}": 11,
    "ttc_s == 1": 6,
    "rise(ttc_s >= 1)": 0,
    "tcc_s >= 1": 0,
    "ttc_s ≥ 1": 6,
    "(ttc_s >= 1": 11,
    "ttc_s >= 1)": 10,
    f"{TTC} {GAP}": 11,
    "ttc_s >=": 8,
    "historically ttc_s": 13,
    "(ttc_s >= 1) + 2 >= 3": 1,
    "1 <= ttc_s <= 3": 11,
    "vehicle_gap_m / ego_speed_mps >= 1": 16,
    "historically[0,1.55](ttc_s >= 1)": 15,
    "historically[1,0.5](ttc_s >= 1)": 12,
    "historically[-1,1](ttc_s >= 1)": 13,
    "historically[0,1e999999999](ttc_s >= 1)": 15,
    "not[0,1](ttc_s >= 1)": 3,
    "once[0,8] once[0,8] ttc_s >= 1": 0,  # reaches back beyond the episode
    f"({TTC}) since[0,12] ({GAP})": 1,  # too many comparisons in a step
    "ttc_s * 1e300 >= 1": 8,
    "ttc_s >= 1e999": 9,
}
DEEP = ("*".join(["vehicle_gap_m"] * 8) + " >= 1", "!" * 400 + TTC, "+".join("1" * 200) + ">= ttc_s")


@pytest.mark.parametrize("formula", [*BAD, *DEEP], ids=lambda formula: formula[:40])
def test_bad_formulas_are_refused_with_their_position(formula):
    with pytest.raises(FormulaError) as caught:
        Monitor([requirement(TTC), requirement(formula)], STEP_S, HORIZON)
    assert caught.value.field == "requirements[1].formula"
    assert caught.value.position == BAD.get(formula, caught.value.position)
    assert caught.value.position is not None


def test_a_formula_of_the_future_is_told_its_past():
    with pytest.raises(FormulaError, match="wanted the past-time operator 'historically'"):
        Monitor([requirement("always(ttc_s >= 1)")], STEP_S, HORIZON)


@given(st.text(alphabet="aHOSY()[],:.0123456789+-*/<>=!&| smtcgpev_", min_size=1, max_size=60))
def test_no_text_gets_through_as_anything_but_a_formula_or_a_formula_error(text):
    with contextlib.suppress(FormulaError):
        Monitor([requirement(text)], STEP_S, HORIZON).update(at_rest())


def test_soft_min_is_equation_7():
    # -(1/2) log(exp(-2) + exp(-4)) = 1 - log(1 + exp(-2)) / 2
    assert soft_min(np.array([1.0, 2.0]), 2.0) == pytest.approx(0.9365359944785137)
    assert soft_min(np.array([0.7]), 5.0) == pytest.approx(0.7)
    assert soft_min(np.array([1.0, 1.0]), 1.0) == pytest.approx(1.0 - math.log(2))


@given(arrays(np.float64, 6, elements=st.floats(-1e6, 1e6)), st.floats(0.1, 100))
def test_soft_min_stays_within_log_m_over_beta_below_the_minimum(robustness, beta):
    least = robustness.min()
    result = soft_min(robustness, beta)
    slack = 1e-9 * max(1.0, abs(least))
    assert least - math.log(6) / beta - slack <= result <= least + slack
