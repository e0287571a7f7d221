"""Recognises addresses of this machine; requests to them bypass any proxy."""

import ipaddress


def is_loopback(host: str) -> bool:
    """Returns whether a host is a loopback address, such as `127.8.9.1`, `[::1]` or `localhost`."""
    host = host.lower().removeprefix("[").removesuffix("]")
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host == "localhost"
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback
