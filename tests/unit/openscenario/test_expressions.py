"""Expressions of OpenSCENARIO as arithmetic of documents."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config.values import term
from risk_sac.errors import ConfigError
from risk_sac.openscenario.scope import combined, translated

NUMBERS = {"a": 7.5, "b": -2.0, "yes": 1.0, "no": 0.0}


def value(text: str) -> float:
    return term(translated(text, {name: name for name in NUMBERS}.__getitem__)).value(NUMBERS)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2 + 3 * 4", 14.0),
        ("(2 + 3) * 4", 20.0),
        ("10 - 4 - 3", 3.0),
        ("12 / 3 / 2", 2.0),
        ("12 / (3 / 2)", 8.0),
        ("-$a + 1", -6.5),
        ("3 - -2", 5.0),
        ("2 * -$b", 4.0),
        ("-$b % 3", 2.0),
        ("7 % -4", 3.0),
        ("pow(2, 3) + sqrt(16)", 12.0),
        ("round(2.5) + floor(-0.5) + ceil(0.2)", 3.0),
        ("sign(-3) + abs(-3)", 2.0),
        ("max($a, $b) - min($a, $b)", 9.5),
        ("sin(pi / 2) + cos(0) + tan(0)", 2.0),
        ("asin(1) + acos(1) + atan(0)", math.pi / 2),
        ("e", math.e),
        ("not $yes or $yes and not $no", 1.0),
        ("not ($yes and $no)", 1.0),
        ("true and false", 0.0),
        ("2.1E-1", 0.21),
    ],
)
def test_an_expression_has_the_value_of_the_standard(text: str, expected: float) -> None:
    assert value(text) == pytest.approx(expected)


@given(st.recursive(
    st.sampled_from(["$a", "$b", "3", "0.5"]),
    lambda inner: st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda three: f"({' '.join(three)})"),
    max_leaves=12,
))  # fmt: skip
def test_parentheses_keep_the_value(text: str) -> None:
    plain = eval(text.replace("$", ""), {}, NUMBERS)  # arithmetic of this test
    assert value(text) == pytest.approx(plain)


def test_parameters_stand_for_what_their_scope_says() -> None:
    assert term(translated("2 * $a", lambda _: "x - 1")).value({"x": 4.0}) == 6.0
    assert term(translated("2 - $a", lambda _: -3.0)).value({}) == 5.0


@pytest.mark.parametrize(
    "text", ["", "1 +", "a", "$", "1; 2", "sin()", "open(1)", "1 < 2", "x" * 3000, "(" * 999 + "1"]
)
def test_what_is_no_expression_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        value(text)


def test_two_values_are_combined_in_this_order() -> None:
    assert term(combined("x + 1", "*", -2.0)).value({"x": 3.0}) == -8.0
