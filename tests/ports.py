"""Free loopback ports for the tests' servers."""

import random
import socket

NOT_EPHEMERAL = range(10_000, 30_000)  # Linux gives clients ports above these, and one may take a port found free
_random = random.Random()  # its own: tests seed the module's, and two processes would choose alike


def free_port() -> int:
    """Returns a port that is free now, and that no client's connection takes."""
    while True:
        port = _random.choice(NOT_EPHEMERAL)
        try:
            with socket.create_server(("127.0.0.1", port)):
                return port
        except OSError:
            continue
