"""The service over REST, each answer held to openapi.yaml."""

import json
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator, Mapping
from typing import Any

import jsonschema_rs

from smoke_test.errors import SmokeError

Answer = dict[str, Any]
ANSWER_S = 30.0
PAGE = 200


class Api:
    """A client that knows the description, and nothing else of the service."""

    def __init__(self, url: str, key: str | None, document: Mapping[str, Any]) -> None:
        self._url = url
        self._key = key
        self._document = document

    def get(self, path: str, query: Mapping[str, Any] | None = None, *, status: int = 200, **names: str) -> Answer:
        """An answer that has this status and is as described.

        Args:
          path: as openapi.yaml has it, with {names}.
          query: parameters of the query.
          status: that is wanted.
          names: what stands in the path.

        Raises:
          SmokeError: it is not.
        """
        return self._call("GET", path, None, query or {}, status, names)

    def post(self, path: str, body: Answer, *, status: int) -> Answer:
        """The same for a POST."""
        return self._call("POST", path, body, {}, status, {})

    def all(self, path: str, **names: str) -> Iterator[Answer]:
        """The items of all pages."""
        query: dict[str, Any] = {"limit": PAGE}
        while True:
            page = self._call("GET", path, None, query, 200, names)
            yield from page["items"]
            if page["next"] is None:
                return
            query["cursor"] = page["next"]

    def wait_ready(self, within_s: float) -> None:
        """Until the service can work.

        Raises:
          SmokeError: it cannot in time.
        """
        end = time.monotonic() + within_s
        while True:
            try:
                self.get("/readyz")
            except (SmokeError, OSError) as error:
                if time.monotonic() > end:
                    raise SmokeError(f"the service is not ready after {within_s:.0f} s: {error}") from error
                time.sleep(0.2)
            else:
                return

    def _call(
        self,
        method: str,
        path: str,
        body: Answer | None,
        query: Mapping[str, Any],
        status: int,
        names: Mapping[str, str],
    ) -> Answer:
        target = self._url + path.format(**names) + ("?" + urllib.parse.urlencode(query) if query else "")
        request = urllib.request.Request(target, method=method)
        if self._key is not None:
            request.add_header("Authorization", f"Bearer {self._key}")
        if body is not None:
            request.add_header("Content-Type", "application/json")
            request.data = json.dumps(body).encode()
        try:
            with urllib.request.urlopen(request, timeout=ANSWER_S) as response:
                got, content = response.status, response.read()
        except urllib.error.HTTPError as error:
            got, content = error.code, error.read()
        if got != status:
            raise SmokeError(f"{method} {path} answers {got}, wanted {status}: {content[:500]!r}")
        answer: Answer = json.loads(content)
        self._check(method, path, status, answer)
        return answer

    def _check(self, method: str, path: str, status: int, answer: Answer) -> None:
        contents = self._document["paths"][path][method.lower()]["responses"][str(status)]["content"]
        schema = next(each for kind, each in contents.items() if "json" in kind)["schema"]
        whole = {"components": self._document["components"], **schema}
        error = next(jsonschema_rs.validator_for(whole).iter_errors(answer), None)
        if error is not None:
            place = "/".join(map(str, error.instance_path))
            raise SmokeError(f"{method} {path} is not as openapi.yaml says, at {place!r}: {error.message[:500]}")
