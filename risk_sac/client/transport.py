"""HTTP with retries: for a bounded time, and only where a repetition does no harm."""

import logging
import random
import time
from collections.abc import Generator, Mapping
from contextlib import closing
from typing import TypeVar

import httpx
from httpx_sse import EventSource, ServerSentEvent, SSEError
from pydantic import ValidationError

from risk_sac import __version__
from risk_sac.client.errors import ClientError, Refused, StreamLost, UnexpectedAnswer, Unreachable
from risk_sac.errors import ConfigError
from risk_sac.loopback import is_loopback
from risk_sac.records import Record

logger = logging.getLogger(__name__)

R = TypeVar("R", bound=Record)

LONGEST_PAUSE_S = 2.0  # between two attempts, unless the service asks for more
NOT_BEGUN = frozenset({429, 503})  # the service has done nothing, whatever was asked
PASSING = NOT_BEGUN | {502, 504}
NEVER_SENT = (httpx.ConnectError, httpx.ConnectTimeout)


def read(type_: type[R], response: httpx.Response) -> R:
    """The record in an answer; fields that this version does not know are no error."""
    try:
        return type_.model_validate_json(response.content, extra="allow")
    except ValidationError as error:
        raise UnexpectedAnswer(response, f"a {type_.__name__}") from error


class Transport:
    """One service, under one key."""

    def __init__(self, url: str, key: str | None, timeout_s: float, patience_s: float) -> None:
        headers = {"User-Agent": f"risk-sac/{__version__}"}
        if key is not None:
            headers["Authorization"] = f"Bearer {key}"
        self.url = url
        try:
            self._http = httpx.Client(
                base_url=url, headers=headers, timeout=timeout_s, trust_env=not is_loopback(httpx.URL(url).host)
            )
        except (ImportError, ValueError, httpx.InvalidURL) as error:
            remedy = "mend HTTP_PROXY, HTTPS_PROXY, ALL_PROXY or NO_PROXY of the environment, or unset it"
            raise ConfigError("proxy", f"what cannot be used ({error})", remedy=remedy) from error
        self._timeout_s = timeout_s
        self.patience_s = patience_s

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def ask(
        self,
        method: str,
        path: str,
        *,
        patience_s: float | None = None,
        query: Mapping[str, str | int | None] | None = None,
        headers: Mapping[str, str] = {},
        body: str | None = None,
        repeatable: bool = True,
    ) -> httpx.Response:
        """The answer to a request, or 304.

        Args:
          method: HTTP method.
          path: below the service's URL.
          patience_s: no further attempt begins after this time; by default the client's.
          query: parameters; None leaves one out.
          headers: of the request.
          body: JSON.
          repeatable: whether the request may be sent twice.

        Raises:
          ClientError: of the last attempt.
          ConfigError: the request cannot be encoded.
        """
        given = {name: value for name, value in (query or {}).items() if value is not None}
        if body is not None:
            headers = {**headers, "Content-Type": "application/json"}
        try:
            request = self._http.build_request(method, path, params=given, headers=headers, content=body)
        except UnicodeEncodeError as error:
            raise ConfigError("", f"{error.object!r}", f"text in {error.encoding}") from error
        return self._answer(request, self.patience_s if patience_s is None else patience_s, repeatable=repeatable)

    def listen(
        self, path: str, last_event_id: str | None, *, silence_s: float, patience_s: float
    ) -> Generator[ServerSentEvent, None, None]:
        """Events as they come, until the service ends the stream.

        Args:
          path: of the stream.
          last_event_id: of an earlier stream; this one starts after it.
          silence_s: StreamLost is raised after so long without a byte.
          patience_s: within this time it has to begin.
        """
        headers = {"Accept": "text/event-stream", "Cache-Control": "no-store"}
        if last_event_id is not None:
            headers["Last-Event-ID"] = last_event_id
        timeout = httpx.Timeout(self._timeout_s, read=silence_s)
        request = self._http.build_request("GET", path, headers=headers, timeout=timeout)
        with closing(self._answer(request, patience_s, stream=True)) as response:
            if response.status_code == httpx.codes.NO_CONTENT:
                return
            try:
                yield from (message for message in EventSource(response).iter_sse() if message.data)
            except SSEError as error:
                raise UnexpectedAnswer(response, "a stream of events") from error
            except httpx.RequestError as error:
                raise StreamLost(self.url, error, passing=True) from error

    def _answer(
        self, request: httpx.Request, patience_s: float, *, repeatable: bool = True, stream: bool = False
    ) -> httpx.Response:
        give_up = time.monotonic() + patience_s
        attempt = 0
        while True:
            try:
                return self._attempt(request, repeatable, stream)
            except ClientError as error:
                backoff_s = min(0.1 * 2 ** min(attempt, 9), LONGEST_PAUSE_S) + random.uniform(0.0, 0.1)
                pause_s = max(backoff_s, error.retry_after_s or 0.0)
                if not error.passing or time.monotonic() + pause_s > give_up:
                    raise
                if attempt == 1:  # a first failure that passes is not worth a line
                    logger.warning("%s; trying again", error)
            attempt += 1
            time.sleep(pause_s)

    def _attempt(self, request: httpx.Request, repeatable: bool, stream: bool) -> httpx.Response:
        try:
            response = self._http.send(request, stream=stream)
            if not response.is_success:
                response.read()
        except httpx.LocalProtocolError as error:
            raise ConfigError("", f"HTTP cannot send this: {error}") from error
        except httpx.RequestError as error:
            raise Unreachable(self.url, error, passing=repeatable or isinstance(error, NEVER_SENT)) from error
        if response.is_success or response.status_code == httpx.codes.NOT_MODIFIED:
            return response
        if response.is_error:
            raise Refused(response, passing=response.status_code in (PASSING if repeatable else NOT_BEGUN))
        raise UnexpectedAnswer(response, "an answer")
