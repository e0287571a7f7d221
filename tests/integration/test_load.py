"""Nothing leaks: a short `make load`, and many episodes in one process."""

import json
import subprocess
import sys

import psutil
import pytest

from tests.server import ROOT

POLLERS, STREAMS, SECONDS = 20, 5, 3


def generate(service, campaigns, seconds):
    """What a generator in a process of its own saw."""
    options = {"port": service.port, "pollers": POLLERS, "streams": STREAMS, "seconds": seconds, "stays": 1}
    flags = [f"--{name}={value}" for name, value in options.items()]
    command = [sys.executable, "-m", "tests.load.generator", *flags, *campaigns]
    return json.loads(subprocess.run(command, cwd=ROOT, check=False, stdout=subprocess.PIPE).stdout)


def test_pollers_and_streams_see_all_without_an_error_and_leave_nothing_open(serve):
    service = serve()
    campaigns = [service.post(label=label, budget={"episodes": 10_000}) for label in ("one", "two")]
    service.wait_until(lambda: all(service.get(each)["progress"]["episodes_done"] for each in campaigns))
    server = psutil.Process(service.process.pid)
    generate(service, campaigns, 2)  # from now on, all connections to the database are open
    before = server.num_fds()
    seen = generate(service, campaigns, SECONDS)
    assert seen["errors"] == {}
    assert (seen["repeated"], seen["missing"]) == (0, 0)
    assert seen["episodes"] > 0
    assert seen["connections"] > 2 * STREAMS  # they broke off and went on
    assert {kind: len(times) for kind, times in seen["latencies_ms"].items()} == {
        "status": 12 * SECONDS,
        "results": 4 * SECONDS,
        "list": 4 * SECONDS,
    }
    service.wait_until(lambda: len(server.net_connections(kind="tcp")) <= 2)  # that it listens on, and our own
    assert server.num_fds() <= before + 2 * STREAMS


EPISODES = 50


@pytest.mark.parametrize(
    "family", [*(pytest.param(name, marks=pytest.mark.torture) for name in ("low", "dense")), "mixed"]
)
def test_fifty_biased_episodes_do_not_take_the_process_down(family: str) -> None:
    command = [sys.executable, "-m", "tests.soak", family, str(EPISODES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.startswith("grew ")
