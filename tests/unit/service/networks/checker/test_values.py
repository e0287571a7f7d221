import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.networks.checker import values
from service.networks.checker.values import Type, points
from service.networks.limits import MAX_COORDINATE, MAX_NUMBER

GOOD: list[tuple[Type, str]] = [
    (values.IDENTIFIER, ":centre_0_1"),
    (values.IDENTIFIER, "-123456#3"),
    (values.IDENTIFIER, "Straße"),
    (values.IDENTIFIERS, ""),
    (values.IDENTIFIERS, "a b  c"),
    (values.LABEL, 'Rue de l\'Église & "co" <1>'),
    (values.WORD, "best"),
    (values.WORD, "-1.5e3"),
    (values.WORD, "12:30:00"),
    (values.WORDS, "passenger bus"),
    (values.COORDINATE, "-0.00"),
    (values.SHAPE, "0.00,-1.60 100.00,-1.60"),
    (values.SHAPE, "0,0,12.5 1,1,12.5"),
    (values.PROBABILITY, "1"),
    (values.PERIOD, "exp(0.25)"),
    (values.EMISSION, "HBEFA4/PC_petrol_Euro-4"),
    (values.PROJECTION, "!"),
    (values.PROJECTION, "+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"),
    (values.BOUNDARY, "0.00,0.00,1000.00,0.00"),
    (values.SIGNALS, "GGrryyuoO"),
    (values.DISTRIBUTION, "normc(1.00,0.10,0.20,2.00)"),
    (values.PARAMETER_KEY, "origId"),
]
BAD: list[tuple[Type, str]] = [
    (values.IDENTIFIER, ""),
    (values.IDENTIFIER, "a b"),
    (values.IDENTIFIER, "${HOME}"),
    (values.IDENTIFIER, "x" * 201),
    (values.IDENTIFIERS, "a b;c"),
    (values.LABEL, "$HOME"),
    (values.LABEL, "two\nlines"),
    (values.LABEL, "x" * 501),
    (values.WORD, ""),
    (values.WORD, "/etc/passwd"),
    (values.WORD, "nan"),
    (values.WORD, "-Infinity"),
    (values.WORD, "1e10"),
    (values.WORDS, "1 2 NaN"),
    (values.COORDINATE, "1e8"),
    (values.COORDINATE, "1_0"),
    (values.COORDINATE, " 1"),
    (values.COORDINATE, "\u0661"),
    (values.SHAPE, ""),
    (values.SHAPE, "0,0 nan,0"),
    (values.SHAPE, "0,0 1e5,0"),
    (values.SHAPE, "0,0 999999999,0"),
    (values.PROBABILITY, "1.1"),
    (values.PERIOD, "exp(exp(1))"),
    (values.EMISSION, "PHEMlight/PC"),
    (values.EMISSION, "HBEFA3/../../x"),
    (values.PROJECTION, "+proj=utm +nadgrids=/etc/passwd"),
    (values.PROJECTION, "+init=epsg:32632"),
    (values.SIGNALS, "GG "),
    (values.BITS, ""),
    (values.PARAMETER_KEY, "device.ssm.file"),
    (values.PARAMETER_KEY, "OutputPrefix"),
]


@pytest.mark.parametrize(("type_", "text"), GOOD, ids=[text for _, text in GOOD])
def test_what_sumo_writes_is_taken(type_: Type, text: str) -> None:
    assert type_.holds(text)


@pytest.mark.parametrize(("type_", "text"), BAD, ids=[text[:30] for _, text in BAD])
def test_what_no_network_needs_is_refused(type_: Type, text: str) -> None:
    assert not type_.holds(text)


@given(st.text(alphabet="0123456789+-.eEnaifxINF_ ,:", max_size=30))
def test_numbers_that_are_taken_are_finite_and_in_range(text: str) -> None:
    if values.FINITE.holds(text):
        assert abs(float(text)) <= MAX_NUMBER
    if values.LENGTH.holds(text):
        assert 0 <= float(text) <= 1e6
    if values.SHAPE.holds(text):
        assert all(math.isfinite(x) and abs(x) < 10 * MAX_COORDINATE for point in points(text) for x in point)


@given(st.one_of(st.floats(), st.integers()).map(str))
def test_a_word_is_never_a_number_that_is_not_finite(text: str) -> None:
    if values.WORD.holds(text):
        assert abs(float(text)) <= MAX_NUMBER


@given(st.text(max_size=50))
def test_no_text_with_a_dollar_passes_any_type(text: str) -> None:
    types = [value for value in vars(values).values() if isinstance(value, Type)]
    assert len(types) > 20
    assert not any(type_.holds(f"{text}${{HOME}}") or type_.holds(f"${text}") for type_ in types)
