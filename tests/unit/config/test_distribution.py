"""Distributions of parameters, against hand-computed values, and their one-line errors."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from risk_sac.config.distribution import Distribution, HistogramLaw, NormalLaw, PoissonLaw, RankCorrelation, UniformLaw
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


def test_weights_are_equal_parts_of_the_axis_of_words_and_rows():
    words = ScenarioParameter(words=("a", "b", "c"), distribution={"kind": "weights", "weights": (1, 0, 3)})
    axis = words.law(0, 1)
    assert [axis.mass(i / 3, (i + 1) / 3) for i in range(3)] == pytest.approx([0.25, 0, 0.75])
    rows = ScenarioParameter(rows=({"x": 1.0}, {"x": 2.0}), distribution={"kind": "weights", "weights": (9, 1)})
    assert rows.law(0, 1).quantile(0.91, 0, 1) == pytest.approx(0.55)
    assert ScenarioParameter(range=(2, 4)).law(2, 4).quantile(0.25, 2, 4) == 2.5


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


@pytest.mark.parametrize(
    ("spearman", "where"),
    [
        (((1, 0.5),), "spearman"),
        (((1, 0.5), (0.4, 1)), "spearman"),
        (((1, 0.5), (0.5, 0.9)), "spearman"),
        (((1, 1), (1, 1)), "spearman"),  # one follows from the other
        (((1, 1.5), (1.5, 1)), "spearman"),
    ],
)
def test_a_matrix_that_is_no_rank_correlation_is_refused(spearman, where):
    with pytest.raises(ValidationError) as caught:
        RankCorrelation(parameters=("a", "b"), spearman=spearman)
    error = caught.value.errors()[0]
    assert where in (getattr(error.get("ctx", {}).get("error"), "field", ""), *map(str, error["loc"]))


def test_correlations_that_cannot_hold_together_are_refused():
    three = ((1, 0.9, -0.9), (0.9, 1, 0.9), (-0.9, 0.9, 1))
    with pytest.raises(ValidationError, match="possible together"):
        RankCorrelation(parameters=("a", "b", "c"), spearman=three)
