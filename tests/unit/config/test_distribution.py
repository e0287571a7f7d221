"""Distributions of parameters, against hand-computed values, and their one-line errors."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from risk_sac.config.distribution import Distribution, HistogramLaw, NormalLaw, PoissonLaw, UniformLaw
from risk_sac.config.scenario import ScenarioParameter

LAWS = (
    {"kind": "uniform", "low": -1, "high": 7},
    {"kind": "normal", "mean": 3, "deviation": 2},
    {"kind": "lognormal", "log_mean": 1, "log_deviation": 0.5},
    {"kind": "poisson", "expected": 3.5},
    {"kind": "histogram", "bins": [{"low": 0, "high": 1, "weight": 1}, {"low": 2, "high": 6, "weight": 3}]},
)


def law(fields: dict[str, object]):
    return TypeAdapter(Distribution).validate_python(fields)


@pytest.mark.parametrize(
    ("fields", "share", "bounds", "value"),
    [
        ({"kind": "uniform", "low": 0, "high": 10}, 0.25, (2, 6), 3),
        ({"kind": "normal", "mean": 10, "deviation": 2}, 0.5, (0, 20), 10),
        ({"kind": "normal", "mean": 10, "deviation": 2}, 0.5, (10, 1000), 10 + 2 * 0.6744897501960817),
        ({"kind": "lognormal", "log_mean": 1, "log_deviation": 0.5}, 0.5, (0, 1e6), math.e),
        # P(0) = e⁻² = 0.135, P(1) = 0.271, P(2) = 0.271; within 1 to 2 both are as likely.
        ({"kind": "poisson", "expected": 2}, 0.4, (0, 50), 1),
        ({"kind": "poisson", "expected": 2}, 0.49, (1, 2), 1),
        ({"kind": "poisson", "expected": 2}, 0.51, (1, 2), 2),
        (LAWS[4], 0.25, (0, 10), 1),
        (LAWS[4], 0.5, (0, 10), 2 + 4 / 3),
        (LAWS[4], 0.5, (4, 10), 5),
    ],
)
def test_quantiles_are_those_of_the_truncated_distribution(fields, share, bounds, value):
    assert law(fields).quantile(share, *bounds) == pytest.approx(value)


@pytest.mark.parametrize("fields", LAWS, ids=lambda fields: fields["kind"])
@given(share=st.floats(0, 1), other=st.floats(0, 1), low=st.floats(0, 3), width=st.floats(1, 5))
def test_quantiles_rise_and_stay_in_the_range(fields, share, other, low, width):
    bounds = (low, low + width)
    first, second = (law(fields).quantile(s, *bounds) for s in sorted((share, other)))
    assert low <= first <= second <= low + width


@pytest.mark.parametrize("fields", LAWS, ids=lambda fields: fields["kind"])
def test_the_usual_range_has_nearly_all_of_it(fields):
    assert law(fields).mass(*law(fields).usual_range) >= 0.997


def test_a_parameter_without_distribution_is_uniform():
    assert ScenarioParameter(range=(2, 4)).drawn(0.25) == 2.5
    assert ScenarioParameter(words=("dry", "wet")).drawn(0.6) == 0.75


def test_weights_choose_words_and_rows():
    words = ScenarioParameter(words=("a", "b", "c"), distribution={"kind": "weights", "weights": (1, 0, 3)})
    assert [words.drawn(share) for share in (0.0, 0.24, 0.26, 1.0)] == pytest.approx([1 / 6, 1 / 6, 5 / 6, 5 / 6])
    rows = ScenarioParameter(rows=({"x": 1.0}, {"x": 2.0}), distribution={"kind": "weights", "weights": (9, 1)})
    assert [rows.drawn(share) for share in (0.89, 0.91)] == [0.25, 0.75]


@pytest.mark.parametrize(
    ("fields", "where"),
    [
        ({"distribution": {"kind": "normal", "mean": 0, "deviation": -1}, "range": (0, 1)}, "deviation"),
        ({"distribution": {"kind": "normal", "mean": 0, "deviation": 1}, "range": (50, 60)}, "distribution"),
        ({"distribution": {"kind": "poisson", "expected": 2}, "range": (1.2, 1.8)}, "distribution"),
        ({"distribution": {"kind": "uniform", "low": 1, "high": 1}, "range": (0, 1)}, "low"),
        ({"distribution": {"kind": "weights", "weights": (1, 2)}, "words": ("a", "b", "c")}, "weights"),
        ({"distribution": {"kind": "weights", "weights": (1, 2)}, "range": (0, 1)}, "distribution"),
        ({"distribution": {"kind": "weights", "weights": (0, 0)}, "words": ("a", "b")}, "weights"),
        ({"distribution": {"kind": "normal", "mean": 0, "deviation": 1}, "words": ("a", "b")}, "distribution"),
        (
            {"distribution": {"kind": "histogram", "bins": [{"low": 0, "high": 1, "weight": 0}]}, "range": (0, 1)},
            "bins",
        ),
        (
            {
                "distribution": {
                    "kind": "histogram",
                    "bins": [{"low": 0, "high": 2, "weight": 1}, {"low": 1, "high": 3, "weight": 1}],
                },
                "range": (0, 1),
            },
            "bins[1].low",
        ),
    ],
)
def test_a_distribution_that_does_not_fit_is_refused_in_one_line(fields, where):
    with pytest.raises(ValidationError) as caught:
        ScenarioParameter(**fields)
    (error,) = caught.value.errors()
    cause = error.get("ctx", {}).get("error")
    field = getattr(cause, "field", "") or str(error["loc"][-1])
    assert where in (field, field.rpartition(".")[2])
    assert "\n" not in error["msg"]


def test_the_kinds_agree_with_their_densities():
    """The derivative of F is the density, at a value of each."""
    assert UniformLaw(kind="uniform", low=0, high=4).mass(1, 2) == pytest.approx(0.25)
    assert NormalLaw(kind="normal", mean=0, deviation=1).mass(-1.96, 1.96) == pytest.approx(0.95, abs=1e-3)
    assert PoissonLaw(kind="poisson", expected=2).mass(1, 2) == pytest.approx(4 * math.exp(-2))
    assert HistogramLaw.model_validate(LAWS[4]).mass(0.5, 3) == pytest.approx((0.5 + 3 / 4) / 4)
