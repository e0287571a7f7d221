"""`python -m tests.torture.ray_numbers WHAT …`: what runs cost on a Ray cluster of this machine, and what they outlive.

throughput --runs 12         the same campaign locally and on two nodes, with as many workers: digests and times
overhead --runs 5            from the start of a run to its first episode, locally and on a warm cluster
scale --runs 1000 --slots 64 stand-ins that sleep, through the service: the server's share of a processor, lost runs
kills --of worker --times 30 kill -9 at random moments of a worker, a raylet, the head or the server

Each ends with a line that has its figures and the machine's load while they were taken.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import psutil

from service.workers.messages import Finished
from tests.builders import run_metrics
from tests.ray_cluster import ROOT, Cluster, running
from tests.server import Service, servers

LONG_S = 3600.0


def throughput(options: argparse.Namespace) -> str:
    """Both ways after one another, first and last locally: the machine's other load changes meanwhile."""
    seeds = options.runs // 2
    campaign = ["--families", "low", "--methods", "risk-sac", "random", "--seeds", str(seeds)]
    campaign += ["--episodes", str(options.episodes), "--verify", "0"]

    def took(name: str, executor: str) -> float:
        began = time.monotonic()
        command = [sys.executable, "-m", "risk_sac", "evaluate", *campaign, "--jobs", "2", "--executor", executor]
        subprocess.run([*command, "--out", str(options.folder / name)], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
        return time.monotonic() - began

    took_s = {"local": [took("local", "local")]}
    with running(options.folder, nodes=2, cpus=1):
        took("warm", "ray") if options.warm else None
        took_s["ray"] = [took("ray", "ray")]
    took_s["local"].append(took("local again", "local"))
    same = digests(options.folder / "ray") == digests(options.folder / "local")
    ratio = median(took_s["local"]) / took_s["ray"][0]
    local = " and ".join(f"{each:.0f}" for each in took_s["local"])
    return (
        f"{len(digests(options.folder / 'ray'))} runs, same digests: {same}; local {local} s, "
        f"two nodes {took_s['ray'][0]:.0f} s, throughput {ratio:.2f} of local"
    )


def digests(folder: Path) -> dict[str, str]:
    """Of a comparison's runs."""
    return {path.parent.name: json.loads(path.read_text())["digest"] for path in folder.glob("runs/*/results.json")}


def overhead(options: argparse.Namespace) -> str:
    """One run after the other; the first on each warms up."""

    def firsts(service: Service) -> list[float]:
        found = []
        for seed in range(options.runs + 1):
            began = time.monotonic()
            campaign_id = service.post(seeds=[seed], budget={"episodes": 1})
            service.wait_until(lambda at=campaign_id: service.get(at)["progress"]["episodes_done"] > 0, LONG_S)
            found.append(time.monotonic() - began)
            service.wait(campaign_id, LONG_S)
        return found[1:]

    with servers(options.folder / "local") as serve:
        here = firsts(serve("service.worker", max_workers=1, lease_s=60))
    with running(options.folder, nodes=1, cpus=1), servers(options.folder / "ray") as serve:
        there = firsts(serve("service.worker", max_workers=1, lease_s=60))
    more_s = median(there) - median(here)
    return (
        f"start to first episode, medians of {options.runs}: local {median(here):.2f} s, Ray {median(there):.2f} s, "
        f"overhead {more_s:.2f} s"
    )


def scale(options: argparse.Namespace) -> str:
    """Through the service, its database and the bridge; the cluster's processes are started before."""
    last = Finished(finished=True, metrics=run_metrics(1), evaluation=None, digest="d", versions={}, wall_s=1.0)
    stand_in = {"SLEEPING_WORKER_LAST": last.model_dump_json(), "SLEEPING_WORKER_S": str(options.sleep_s)}
    with (
        running(options.folder, nodes=2, cpus=options.slots // 2, RISK_SAC_RAY_LEASE_S="120", **stand_in),
        servers(options.folder) as serve,
    ):
        service = serve("sleeping_worker", max_workers=1024, lease_s=120)
        service.wait(service.post(seeds=list(range(options.slots)), budget={"episodes": 1}), LONG_S)
        server = psutil.Process(service.process.pid)
        bridge = next(each for each in server.children() if "risk_sac.execution.ray.bridge" in each.cmdline())
        spent = cpu_s(server), cpu_s(bridge)
        began = time.monotonic()
        campaigns = [
            service.post(seeds=list(range(first, min(first + 100, options.runs))), budget={"episodes": 1})
            for first in range(0, options.runs, 100)
        ]
        states = [run["state"] for each in campaigns for run in service.wait(each, LONG_S)["runs"]]
        took_s = time.monotonic() - began
        shares = [(cpu_s(process) - before) / took_s for process, before in zip((server, bridge), spent, strict=True)]
    ideal_s = -(-options.runs // options.slots) * options.sleep_s
    lost = options.runs - states.count("succeeded")
    return (
        f"{options.runs} runs of {options.sleep_s:g} s on {options.slots} slots: {lost} lost; "
        f"drained in {took_s:.0f} s, ideal {ideal_s:.0f} s ({took_s / ideal_s - 1:+.1%}); "
        f"of a core the server took {shares[0]:.1%}, the bridge {shares[1]:.1%}"
    )


def cpu_s(process: psutil.Process) -> float:
    """Processor time so far."""
    times = process.cpu_times()
    return float(times.user + times.system)


def kills(options: argparse.Namespace) -> str:
    """A campaign that was never disturbed says what the others must come to."""
    chance = random.Random(options.seed)
    spec = {
        "families": ["low"], "methods": ["risk-sac", "random"], "seeds": [0], "budget": {"episodes": options.episodes},
        "learner": {"checkpoint_every": 3, "agent": {"warmup_steps": 200}, "warm_start": {"episodes": 2}},
    }  # fmt: skip
    with servers(options.folder / "local") as serve:
        service = serve("service.worker", lease_s=60)
        undisturbed = outcome(service, service.post(**spec))
    done, slowest_s, campaigns = 0, 0.0, []
    with (
        running(options.folder, nodes=2, cpus=1, RISK_SAC_RAY_LEASE_S="10") as cluster,
        servers(options.folder / "ray") as serve,
    ):
        service = serve("service.worker", lease_s=60, attempts=100)
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
        ] + [str(each) for each in service.data_dir.glob("campaigns/*/*/.attempts")]  # fmt: skip
    changed = sum(each != undisturbed for each in outcomes)
    return (
        f"kill -9 of a {options.of}, {done} times in {len(campaigns)} campaigns: {changed} campaigns with another "
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
    found = [each for each in workers(service) if "service.worker" in each.cmdline()]
    if found:
        chance.choice(found).kill()
    return bool(found)


def _raylet(cluster: Cluster, service: Service, chance: random.Random) -> bool:
    """Of the node that is not the head's; a supervisor would start it again, as is done here."""
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


def _server(cluster: Cluster, service: Service, chance: random.Random) -> bool:
    service.stop(signal.SIGKILL)
    service.start()
    return True


KILL = {"worker": _worker, "raylet": _raylet, "head": _head, "server": _server}


def main() -> None:
    """Prints one line of figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("throughput", "overhead", "scale", "kills"))
    parser.add_argument("--runs", type=int)
    parser.add_argument("--episodes", type=int, default=30)
    parser.add_argument("--warm", action="store_true")
    parser.add_argument("--slots", type=int, default=64)
    parser.add_argument("--sleep-s", type=float, default=30.0)
    parser.add_argument("--of", choices=KILL, default="worker")
    parser.add_argument("--times", type=int, default=30)
    parser.add_argument("--within-s", type=float, default=9.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.runs = options.runs or {"throughput": 12, "overhead": 5, "scale": 1000}.get(options.what)
    with tempfile.TemporaryDirectory() as folder:
        options.folder = Path(folder)
        for name in ("local", "ray"):
            (options.folder / name).mkdir()
        line = globals()[options.what](options)
    print(f"{line}; load {os.getloadavg()[1]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
