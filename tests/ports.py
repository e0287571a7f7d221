"""Free loopback ports for the tests' servers."""

import random
import socket

UNCLAIMED = range(20_000, 30_000)  # Linux gives its clients ports above these, Ray its workers ports below
_random = random.Random()  # its own: tests seed the module's, and two processes would choose alike


def free_port() -> int:
    """Returns a port that is free, and that no connection of a client takes."""
    while True:
        port = _random.choice(UNCLAIMED)
        try:
            with socket.create_server(("127.0.0.1", port)):
                return port
        except OSError:
            continue
