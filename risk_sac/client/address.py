"""Checks the address of the service and the API key before anything is sent."""

from collections.abc import Mapping
from pathlib import Path

from pydantic import HttpUrl, TypeAdapter, ValidationError

from risk_sac.config.text import read_text
from risk_sac.errors import ConfigError

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
    """The key in RISK_SAC_API_KEY, or in the file that RISK_SAC_API_KEY_FILE names; None where there is neither.

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
