import base64

import pytest
from fastapi import HTTPException
from hypothesis import given
from hypothesis import strategies as st

from service.api.pages import Cursors
from service.api.problems import ProblemError
from service.api.representations import accepted, takes

OFFERED = ("application/json", "text/markdown", "text/csv")
BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,*/*;q=0.8"


@pytest.mark.parametrize(
    ("accept", "chosen"),
    [
        ("", "application/json"),
        ("*/*", "application/json"),
        (BROWSER, "application/json"),
        ("text/*", "text/markdown"),
        ("text/csv", "text/csv"),
        ("TEXT/CSV; charset=utf-8", "text/csv"),
        ("text/markdown;q=0.3, text/csv;q=0.7", "text/csv"),
        ("*/*;q=0.1, text/markdown", "text/markdown"),
        ("text/*, text/markdown;q=0", "text/csv"),
        ("application/json;q=0, */*", "text/markdown"),
        ("text/csv;q=nonsense", "text/csv"),
        (",, text/csv ,", "text/csv"),
    ],
)
def test_the_most_specific_range_decides_and_the_best_quality_wins(accept, chosen):
    assert accepted(accept, OFFERED) == chosen


@pytest.mark.parametrize("accept", ["image/png", "text/csv;q=0", "text", ";;;", "*/*;q=0.000"])
def test_nothing_acceptable_is_a_406_that_lists_what_there_is(accept):
    with pytest.raises(HTTPException, match="text/markdown") as caught:
        accepted(accept, OFFERED)
    assert caught.value.status_code == 406


@pytest.mark.parametrize("header", ["gzip", "br, GZip", "gzip;q=0.001", "deflate;q=0.5 , gzip ; q=1"])
def test_an_encoding_that_is_named_is_taken(header):
    assert takes(header, "gzip")


@pytest.mark.parametrize("header", ["", "br", "xgzip", "gzip;q=0", "br, gzip;q=0.0", "*;q=0", ",,"])
def test_an_encoding_that_is_not_named_or_refused_is_not_taken(header):
    assert not takes(header, "gzip")


CURSORS = Cursors(bytes(range(32)))
numbers = st.integers(0, 2**64 - 1)


@given(numbers, st.sampled_from([None, "maps", "rivals"]))
def test_a_cursor_leads_back_to_its_number(number, project):
    cursor = CURSORS.encode(number, "campaigns", project)
    assert CURSORS.decode(cursor, "campaigns", project) == number
    assert CURSORS.encode(number, "campaigns", project) == cursor


def test_cursors_of_neighbours_have_nothing_in_common():
    contents = [base64.urlsafe_b64decode(CURSORS.encode(number, "campaigns", "maps") or "") for number in range(1000)]
    for at in range(len(contents[0])):
        assert len({content[at] for content in contents}) > 200, "a byte tells of the number"


def test_a_cursor_holds_for_one_list_one_reader_and_one_service():
    cursor = CURSORS.encode(7, "campaigns", "maps")
    for cursors, listed, project in (
        (CURSORS, "networks", "maps"),
        (CURSORS, "campaigns", "rivals"),
        (CURSORS, "campaigns", None),
        (Cursors(bytes(32)), "campaigns", "maps"),
    ):
        with pytest.raises(ProblemError):
            cursors.decode(cursor, listed, project)


@given(
    st.one_of(st.text(max_size=100), st.binary(max_size=60).map(lambda some: base64.urlsafe_b64encode(some).decode()))
)
def test_what_is_made_up_is_refused(cursor):
    with pytest.raises(ProblemError):
        CURSORS.decode(cursor, "campaigns", None)


@given(st.integers(0, 191))
def test_a_flipped_bit_is_noticed(bit):
    content = bytearray(base64.urlsafe_b64decode(CURSORS.encode(7, "campaigns", None) or ""))
    content[bit // 8] ^= 1 << bit % 8
    with pytest.raises(ProblemError):
        CURSORS.decode(base64.urlsafe_b64encode(content).decode(), "campaigns", None)
