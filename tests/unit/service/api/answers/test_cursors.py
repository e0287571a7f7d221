import base64

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.api.pages import Cursors
from service.api.problems import ProblemError

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
