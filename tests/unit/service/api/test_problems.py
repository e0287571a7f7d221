import asyncio
from http import HTTPStatus

import pytest
from starlette.requests import Request

from risk_sac.errors import DamagedError
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
