"""`python -m tests.torture.ray_numbers`: kills on a Ray cluster of this machine.

--of worker --times 30 kill -9 at random moments of a worker, a raylet, the head or the server; or a node hangs

It ends with a line that has the figures and the machine's load while they were taken.
"""

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

import psutil

from tests.ray_cluster import Cluster, running
from tests.server import Service, servers

LONG_S = 3600.0
WORKER = "risk_sac.execution.worker"


def kills(options: argparse.Namespace) -> str:
    """Compares disturbed campaigns with one that was never disturbed."""
    chance = random.Random(options.seed)
    spec = {
        "families": ["low"], "methods": ["risk-sac", "random"], "seeds": [0], "budget": {"episodes": options.episodes},
        "learner": {"checkpoint_every": 3, "agent": {"warmup_steps": 200}, "warm_start": {"episodes": 2}},
    }  # fmt: skip
    with servers(options.folder / "local") as serve:
        service = serve(WORKER, lease_s=60)
        undisturbed = outcome(service, service.post(**spec))
    done, slowest_s, campaigns = 0, 0.0, []
    with (
        running(options.folder, nodes=2, cpus=1, RISK_SAC_RAY_LEASE_S="10") as cluster,
        servers(options.folder / "ray") as serve,
    ):
        service = serve(WORKER, lease_s=60, attempts=100)
        campaigns.append(service.post(**spec))
        while done < options.times:
            time.sleep(chance.uniform(1, options.within_s))
            if service.get(campaigns[-1])["state"] == "succeeded":
                campaigns.append(service.post(**spec))
            known = service.episode_ids(campaigns[-1])
            struck = time.monotonic()
            if not KILL[options.of](cluster, service, chance):
                continue
            done += 1
            assert service.episode_ids(campaigns[-1])[: len(known)] == known, "episodes were lost"
            slowest_s = max(slowest_s, time.monotonic() - struck)
            print(f"  {options.of} {done} of {options.times}, campaign {len(campaigns)}", file=sys.stderr, flush=True)
        outcomes = [outcome(service, each) for each in campaigns]
        deadline = time.monotonic() + 60
        while list(cluster.scratch.glob("*")) and time.monotonic() < deadline:
            time.sleep(0.2)
        left = [str(each.name) for each in cluster.scratch.glob("*")] + [
            " ".join(each.cmdline()[:4]) for each in workers(service)
        ]  # fmt: skip
    changed = sum(each != undisturbed for each in outcomes)
    what = "a node that hangs" if options.of == "hang" else f"kill -9 of a {options.of}"
    return (
        f"{what}, {done} times in {len(campaigns)} campaigns: {changed} campaigns with another "
        f"digest or other episodes; left behind: {left or 'nothing'}"
    )


def outcome(service: Service, campaign_id: str) -> tuple[dict[str, str], list[str]]:
    """Digest of each run, and every episode."""
    campaign = service.wait(campaign_id, LONG_S)
    assert campaign["state"] == "succeeded", campaign["reason"]
    found = {run["id"]: run["digest"] for run in service.get(campaign_id, "/results")["runs"]}
    return found, sorted(service.episode_ids(campaign_id))


def workers(service: Service) -> list[psutil.Process]:
    """Processes that execute runs, wherever they were started."""
    scratch = os.environ.get("RISK_SAC_RAY_SCRATCH_DIR", "-")
    found = []
    for process in psutil.process_iter():
        try:
            if any(scratch in part for part in process.cmdline()):
                found.append(process)
        except psutil.Error:
            continue
    return found


def _worker(cluster: Cluster, service: Service, chance: random.Random) -> bool:
    found = [each for each in workers(service) if WORKER in each.cmdline()]
    if found:
        chance.choice(found).kill()
    return bool(found)


def _raylet(cluster: Cluster, service: Service, chance: random.Random) -> bool:
    """Kills the second node's raylet and starts it again, as a supervisor."""
    killed = cluster.kill(1, "raylet")
    cluster.end(1)
    cluster.add(1)
    return bool(killed)


def _head(cluster: Cluster, service: Service, chance: random.Random) -> bool:
    """Its server first; the cluster is then started again as a whole."""
    killed = cluster.kill(0, "gcs_server")
    for node in (1, 0):
        cluster.end(node)
    cluster.start(2)
    return bool(killed)


def _hang(cluster: Cluster, service: Service, chance: random.Random) -> bool:
    """Stops all processes of a node beyond its lease, then continues them."""
    if not any("raylet" in name for name in cluster.names(1)):  # the head has given it up since the last time
        cluster.end(1)
        cluster.add(1)
    at_work = any(WORKER in each.cmdline() for each, _ in cluster.processes(1))
    cluster.kill(1, "", number_of_signal=signal.SIGSTOP)
    time.sleep(chance.uniform(12, 40))
    cluster.kill(1, "", number_of_signal=signal.SIGCONT)
    return at_work


def _server(cluster: Cluster, service: Service, chance: random.Random) -> bool:
    service.stop(signal.SIGKILL)
    service.start()
    return True


KILL = {"worker": _worker, "raylet": _raylet, "head": _head, "server": _server, "hang": _hang}


def main() -> None:
    """Prints one line of figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=30)
    parser.add_argument("--of", choices=KILL, default="worker")
    parser.add_argument("--times", type=int, default=30)
    parser.add_argument("--within-s", type=float, default=9.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        options.folder = Path(folder)
        for name in ("local", "ray"):
            (options.folder / name).mkdir()
        line = kills(options)
    print(f"{line}; load {os.getloadavg()[1]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
