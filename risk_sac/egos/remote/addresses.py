"""Addresses of the servers of a remote ego, as an operator writes them."""

import re

from risk_sac.errors import ConfigError

MOST = 1024
EXPECTED = "host:port, host:first-last or unix:path, or several of them with commas between"
REMEDY = "write for example 127.0.0.1:7000-7015"
_PORTS = re.compile(r"(?P<host>[\w.-]+|\[[0-9A-Fa-f:.%\w]+\]):(?P<first>\d{1,5})(?:-(?P<last>\d{1,5}))?", re.ASCII)
_UNIX = re.compile(r"unix:[^,\s]+")


def addresses_of(text: str) -> tuple[str, ...]:
    """Returns the addresses that a text names, one per server.

    `host:first-last` names consecutive ports. An address that is named twice is of a server that plays two episodes at
    a time.

    Raises:
      ConfigError: the text names no address, or more than `MOST`; its field is empty.
    """
    addresses = []
    for part in text.split(","):
        addresses += _addresses(part.strip(), text)
    if len(addresses) > MOST:
        raise ConfigError("", f"{len(addresses)} addresses", f"at most {MOST}", "name fewer ports")
    return tuple(addresses)


def _addresses(part: str, text: str) -> list[str]:
    if _UNIX.fullmatch(part):
        return [part]
    named = _PORTS.fullmatch(part)
    if named is None:
        inside = "" if part == text else f" in {text!r}"
        raise ConfigError("", f"{part!r}{inside}", EXPECTED, REMEDY)
    first, last = int(named["first"]), int(named["last"] or named["first"])
    if not 1 <= first <= last <= 65535:
        raise ConfigError("", f"{part!r}", "ports from 1 to 65535, the first not beyond the last", REMEDY)
    return [f"{named['host']}:{port}" for port in range(first, last + 1)]
