"""Probability distributions of variation files."""

from typing import Any

import pytest

from risk_sac.config.distribution import HistogramLaw, LognormalLaw, NormalLaw, PoissonLaw, UniformLaw, WeightsLaw
from risk_sac.errors import ConfigError
from risk_sac.openscenario.distributions import NO_SCOPE, Variation
from risk_sac.openscenario.parameters import Varied
from risk_sac.openscenario.scope import At
from risk_sac.openscenario.sources import parse

RANGE = '<Range lowerLimit="1" upperLimit="9"/>'


def varied(inner: str, remarks: list[str] | None = None) -> list[Varied]:
    text = f'<x><Stochastic numberOfTestRuns="10" randomSeed="1"><StochasticDistribution parameterName="a">{inner}'
    block = At(parse(f"{text}</StochasticDistribution></Stochastic></x>".encode(), "f.xosc"), NO_SCOPE)
    return Variation({"a": "double"}, remarks if remarks is not None else []).read(block)


@pytest.mark.parametrize(
    ("inner", "law"),
    [
        (f"<UniformDistribution>{RANGE}</UniformDistribution>", UniformLaw(kind="uniform", low=1, high=9)),
        (
            f'<NormalDistribution expectedValue="5" variance="4">{RANGE}</NormalDistribution>',
            NormalLaw(kind="normal", mean=5, deviation=2),
        ),
        (
            f'<LogNormalDistribution expectedValue="1" variance="0.25">{RANGE}</LogNormalDistribution>',
            LognormalLaw(kind="lognormal", log_mean=1, log_deviation=0.5),
        ),
        (
            f'<PoissonDistribution expectedValue="3">{RANGE}</PoissonDistribution>',
            PoissonLaw(kind="poisson", expected=3),
        ),
        (
            f'<Histogram><Bin weight="2">{RANGE}</Bin></Histogram>',
            HistogramLaw(kind="histogram", bins=({"low": 1, "high": 9, "weight": 2},)),
        ),
    ],
)
def test_a_distribution_is_kept_beside_its_range(inner: str, law: Any) -> None:
    (part,) = varied(inner)
    assert part.parameter is not None
    assert part.parameter.distribution == law
    assert part.parameter.range == (1.0, 9.0)


def test_a_normal_distribution_without_a_range_gets_its_usual_one() -> None:
    (part,) = varied('<NormalDistribution expectedValue="5" variance="4"/>')
    assert part.parameter is not None
    assert part.parameter.range is not None
    low, high = part.parameter.range
    assert low + high == pytest.approx(10.0)
    assert low < -1.0


def test_a_probability_set_gives_rows_with_weights() -> None:
    elements = '<Element value="x" weight="1"/><Element value="y" weight="3"/>'
    (part,) = varied(f"<ProbabilityDistributionSet>{elements}</ProbabilityDistributionSet>")
    assert part.rows == ({"a": "x"}, {"a": "y"})
    assert part.weights == WeightsLaw(kind="weights", weights=(1, 3))


def test_a_distribution_of_the_users_own_is_told() -> None:
    remarks: list[str] = []
    assert varied('<UserDefinedDistribution type="t">x</UserDefinedDistribution>', remarks) == []
    assert "<UserDefinedDistribution>" in remarks[0]


@pytest.mark.parametrize("variance", ["0", "-1", "x"])
def test_a_variance_that_is_none_is_refused(variance: str) -> None:
    with pytest.raises(ConfigError) as told:
        varied(f'<NormalDistribution expectedValue="5" variance="{variance}"/>')
    assert "<NormalDistribution>" in told.value.field
