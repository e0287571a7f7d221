import asyncio
import base64
from http import HTTPStatus

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.requests import Request

from risk_sac.errors import DamagedError
from service.api.pages import Cursors
from service.api.problems import RETRY_S, ProblemError, Reason, problem_response
from service.app import create_app
from service.errors import BusyError, OutdatedError, QuotaError, StorageError
from service.settings import ServiceSettings

ASKED_AGAIN = (429, 503)


@pytest.mark.parametrize("reason", Reason)
@pytest.mark.parametrize("headers", [{}, {"Connection": "close"}])
def test_each_429_and_503_and_no_other_problem_says_when_to_ask_again(reason: Reason, headers: dict[str, str]) -> None:
    for status in (status for status in HTTPStatus if status >= 400):
        answer = problem_response("/", ProblemError(status, reason, "", headers=headers))
        assert answer.headers.get("retry-after") == (str(RETRY_S) if status in ASKED_AGAIN else None)
        assert answer.headers.get("connection") == headers.get("Connection")


@pytest.mark.parametrize(
    ("error", "status", "retry_s"),
    [
        (StorageError("x"), 503, RETRY_S),
        (OutdatedError("x"), 503, RETRY_S),
        (DamagedError("x"), 503, RETRY_S),
        (BusyError("x", 7), 503, 7),
        (QuotaError("x", 6.2), 429, 7),
    ],
)
def test_an_error_says_when_to_ask_again(error: Exception, status: int, retry_s: int) -> None:
    handlers = create_app(ServiceSettings()).exception_handlers
    handler = next(handlers[kind] for kind in type(error).__mro__ if kind in handlers)
    request = Request({"type": "http", "method": "GET", "path": "/", "headers": [], "server": ("localhost", 80)})
    answer = asyncio.run(handler(request, error))  # type: ignore[arg-type]
    assert (answer.status_code, answer.headers["retry-after"]) == (status, str(retry_s))


def test_the_description_of_each_429_and_503_has_the_header() -> None:
    document = create_app(ServiceSettings()).openapi()
    shared = document["components"]["responses"]
    for path, operations in document["paths"].items():
        for status in ASKED_AGAIN:
            for operation in operations.values():
                response = operation["responses"].get(str(status), {})
                response = shared[response["$ref"].rpartition("/")[2]] if "$ref" in response else response
                assert not response or "Retry-After" in response["headers"], (path, status)


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
