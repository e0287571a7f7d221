"""What several processes say at once."""

import json
import os
import socket
import subprocess
import sys

PROGRAM = "from pathlib import Path; from risk_sac.failures.replay import _say; _say(Path('run'), same=[1, 2])"


def test_a_line_is_one_write_whether_output_is_buffered_or_not() -> None:
    for unbuffered in ("", "1"):  # the image sets it
        read, write = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)  # where each write is a message of its own
        with read, write:
            environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
            subprocess.run([sys.executable, "-c", PROGRAM], stdout=write, env=environment, check=True, timeout=600)
            line = read.recv(1000).decode()
        assert line.endswith("\n")
        assert json.loads(line) == {"folder": "run", "same": [1, 2]}
