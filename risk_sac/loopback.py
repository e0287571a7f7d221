"""Which addresses are this machine's own; what goes there goes through no proxy."""

import ipaddress


def is_loopback(host: str) -> bool:
    """Whether only processes of this machine reach a server that listens there: `127.8.9.1`, `[::1]`, `localhost`."""
    host = host.lower().removeprefix("[").removesuffix("]")
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host == "localhost"
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback
