"""HTTP transport of the client, its errors, and following a campaign."""

import json
import logging
import math
import random
import time
from collections.abc import Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, TypeVar

import httpx
from httpx_sse import EventSource, ServerSentEvent, SSEError
from pydantic import BaseModel, HttpUrl, TypeAdapter, ValidationError

from risk_sac import __version__
from risk_sac.config.base import read_text
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.host.machine import is_loopback
from risk_sac.records import FINAL, Campaign, FieldProblem, Record


class ClientError(RiskSacError):
    """Root of the client's errors."""

    passing: bool = False  # a retry may help and does no harm
    retry_after_s: float | None = None  # the wait that the service asked for


class Unreachable(ClientError):
    """No answer, or an incomplete one."""

    def __init__(self, url: str, error: httpx.RequestError, *, passing: bool) -> None:
        super().__init__(f"{url} does not answer: {str(error) or type(error).__name__}")
        self.passing = passing


class StreamLost(Unreachable):
    """A stream of events that broke; it resumes after the last event."""


class _Problem(BaseModel):
    detail: str
    reason: str = ""
    errors: tuple[FieldProblem, ...] = ()


class Refused(ClientError):
    """A problem that the service answered; from a proxy only a status."""

    def __init__(self, response: httpx.Response, *, passing: bool) -> None:
        try:
            problem = _Problem.model_validate_json(response.content, extra="allow")
        except ValidationError:
            problem = _Problem(detail=response.reason_phrase)
        super().__init__(f"{response.url} answered {response.status_code}: {problem.detail}")
        self.status = response.status_code
        self.reason = problem.reason  # one word that is stable for each cause, such as `unknown_id`; empty from a proxy
        self.detail = problem.detail  # what was got and wanted, for people
        self.fields = problem.errors  # to blame; may be none
        self.passing = passing
        self.retry_after_s = retry_after_s(response)


class UnexpectedAnswer(ClientError):
    """The answer is not what this version of the service says."""

    def __init__(self, response: httpx.Response, wanted: str) -> None:
        type_ = response.headers.get("content-type", "no content-type")
        super().__init__(
            f"{response.url} answered {response.status_code} with {type_}; wanted {wanted}: "
            "is it a RISK-SAC service, and not much older or newer than this client?"
        )


class Overdue(ClientError):
    """A campaign that outlasts the caller's timeout; it continues."""


def retry_after_s(response: httpx.Response) -> float | None:
    """Returns a Retry-After header's seconds (number or date); None if invalid."""
    value = response.headers.get("retry-after", "")
    try:
        seconds = float(value)
    except ValueError:
        try:
            at = parsedate_to_datetime(value)
        except ValueError:
            return None
        seconds = (at.replace(tzinfo=at.tzinfo or UTC) - datetime.now(UTC)).total_seconds()
    return max(0.0, seconds) if math.isfinite(seconds) else None


DEFAULT_URL = "http://127.0.0.1:8000"

_URL = TypeAdapter(HttpUrl)


def checked_url(url: str) -> str:
    """The URL of a service.

    Raises:
      ConfigError: it is none, or holds a password, which would show in messages and reports.
    """
    try:
        parsed = _URL.validate_python(url)
    except ValidationError as error:
        raise ConfigError("url", repr(url), f"http(s)://host[:port]: {error.errors()[0]['msg']}") from error
    if parsed.username or parsed.password:
        raise ConfigError("url", "a URL that holds a user or a password", "the key in RISK_SAC_API_KEY")
    return str(parsed).rstrip("/")


def api_key(environment: Mapping[str, str]) -> str | None:
    """Returns the key of RISK_SAC_API_KEY or of RISK_SAC_API_KEY_FILE's file, or None.

    Raises:
      ConfigError: the file cannot be read.
    """
    key, file = environment.get("RISK_SAC_API_KEY"), environment.get("RISK_SAC_API_KEY_FILE")
    if key or not file:
        return key or None
    return read_text(Path(file), "RISK_SAC_API_KEY_FILE").strip()


def checked_key(key: str) -> str:
    """A key that a header can hold.

    Raises:
      ConfigError: it cannot; the message does not show it.
    """
    if not key or not all("!" <= character <= "~" for character in key):
        got = "an empty one, or one with a space, a control character or a letter outside of ASCII"
        raise ConfigError("API key", got, "it as `risk-sac keys` printed it")
    return key


logger = logging.getLogger(__name__)

R = TypeVar("R", bound=Record)

LONGEST_PAUSE_S = 2.0  # between two attempts, unless the service asks for more
NOT_BEGUN = frozenset({429, 503})  # the service has done nothing, whatever was asked
PASSING = NOT_BEGUN | {502, 504}
NEVER_SENT = (httpx.ConnectError, httpx.ConnectTimeout)


def read(type_: type[R], response: httpx.Response) -> R:
    """Reads the record of an answer; unknown fields are allowed."""
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
        body: str | bytes | None = None,
        repeatable: bool = True,
    ) -> httpx.Response:
        """The answer to a request, or 304.

        Args:
          method: HTTP method.
          path: below the service's URL.
          patience_s: no further attempt begins after this time; by default the client's.
          query: parameters; None leaves one out.
          headers: of the request.
          body: JSON, unless the headers say otherwise.
          repeatable: whether the request may be sent twice.

        Raises:
          ClientError: of the last attempt.
          ConfigError: the request cannot be encoded.
        """
        given = {name: value for name, value in (query or {}).items() if value is not None}
        if body is not None:
            headers = {"Content-Type": "application/json", **headers}
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


AWAY_S = 120.0  # how long a service that was there may be away, as when it is restarted
SILENCE_S = 45.0  # three times what the service leaves between two signs of life
LOOK_S = 1.0  # between two looks at a campaign, and between two streams of events


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """An event of a campaign."""

    id: str  # opaque; the stream goes on after it
    name: str  # episode | failure (instead of it) | state
    data: dict[str, Any]

    @property
    def last(self) -> bool:
        """Whether the campaign has ended with it."""
        return self.name == "state" and self.data.get("run_id") is None and self.data.get("state") in FINAL


def events(transport: Transport, path: str, last_event_id: str | None, away_s: float) -> Iterator[Event]:
    """Yields the events of the campaign at a path; see `Client.events`."""
    patience_s = transport.patience_s
    while True:
        heard = False
        try:
            for message in transport.listen(
                f"{path}/events", last_event_id, silence_s=SILENCE_S, patience_s=patience_s
            ):
                event = Event(id=message.id, name=message.event, data=json.loads(message.data))
                heard, last_event_id = True, event.id or last_event_id
                yield event
                if event.last:
                    return
            # A stream also ends when the service stops; the next one continues it.
            if not heard and read(Campaign, transport.ask("GET", path, patience_s=away_s)).ended:
                return
        except StreamLost:
            pass
        patience_s = away_s
        time.sleep(LOOK_S)


def follow(transport: Transport, path: str, timeout_s: float | None, away_s: float) -> Iterator[Campaign]:
    """Yields the states of the campaign at a path; see `Client.follow`."""
    deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
    patience_s, headers = transport.patience_s, dict[str, str]()
    known: Campaign | None = None
    while (left_s := deadline - time.monotonic()) > 0:
        try:
            response = transport.ask("GET", path, headers=headers, patience_s=min(patience_s, left_s))
        except Unreachable:
            if time.monotonic() < deadline:
                raise
            break
        if response.status_code != httpx.codes.NOT_MODIFIED:
            campaign = read(Campaign, response)
            if campaign != known:
                yield campaign
            if campaign.ended:
                return
            patience_s, headers, known = away_s, {"If-None-Match": response.headers.get("etag", "")}, campaign
        time.sleep(min(LOOK_S, max(0.0, deadline - time.monotonic())))
    raise Overdue(f"it did not end within {timeout_s:g} s; it goes on, and can be followed again")
