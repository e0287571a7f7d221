"""Digests of small runs, recorded by kind of processor and versions.

    python -m tests.acceptance.golden_digests

records them for this machine in the file beside this one. Do so after a change that is meant to change results, and
say in its commit what changed them.
"""

import json
import platform
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from llvmlite import binding

from risk_sac.config import (
    AgentConfig,
    Budget,
    LearnerConfig,
    ReplayConfig,
    RunSpec,
    SceneOptimizerConfig,
    WarmStartConfig,
)
from risk_sac.search.loop import execute_run
from tests.listener import Listener

RECORDED = Path(__file__).with_suffix(".json")
METHODS = ("random", "bo-only", "risk-sac")
SEEDS = {"low": 67, "mixed": 0, "dense": 68}  # at least one of each family's runs has a contact to be judged
PACKAGES = ("botorch", "gpytorch", "libsumo", "llvmlite", "numba", "numpy", "scipy", "shapely", "torch")
# Small enough for a second, and still learning and modelling before the run is over.
BUDGET = Budget(episodes=3, evaluation_episodes=1)
LEARNER = LearnerConfig(
    agent=AgentConfig(hidden_sizes=(32, 32), batch_size=32, warmup_steps=100, updates_per_step=1.0),
    replay=ReplayConfig(capacity=1000),
    warm_start=WarmStartConfig(episodes=1),
    scenes=SceneOptimizerConfig(initial_scenes=2, refit_every=1, candidates=32, exploration=0.0),
)


def fingerprint() -> dict[str, str]:
    """Returns what digests depend on beside the code, to the last bit."""
    return {
        "machine": platform.machine(),
        "processor": binding.get_host_cpu_name(),  # what numba compiles for
        "vectors": torch.backends.cpu.get_cpu_capability(),  # avx2 and fma, avx512 or less
        "libc": "-".join(platform.libc_ver()),
        "python": ".".join(platform.python_version_tuple()[:2]),
        **{package: version(package) for package in PACKAGES},
    }


def digest(family: str, method: str, folder: Path) -> str:
    spec = RunSpec.model_validate(
        {"family": family, "method": method, "seed": SEEDS[family], "budget": BUDGET, "learner": LEARNER}
    )
    return execute_run(spec, folder, Listener()).digest


def read() -> list[dict[str, Any]]:
    """One recording per fingerprint."""
    recordings: list[dict[str, Any]] = json.loads(RECORDED.read_text())
    return recordings


def recorded(wanted: dict[str, str]) -> dict[str, str] | None:
    """Returns recorded digests by family and method for this fingerprint, or None."""
    return next((one["digests"] for one in read() if one["fingerprint"] == wanted), None)


def record() -> None:
    """Replaces this machine's recording; drops all others if it has changed."""
    here, digests = fingerprint(), {}
    for name in (f"{family} {method}" for family in SEEDS for method in METHODS if method != "boundary"):
        with TemporaryDirectory() as folder:
            digests[name] = digest(*name.split(), Path(folder))
        print(name, digests[name])
    kept = read() if RECORDED.exists() and recorded(here) in (None, digests) else []
    others = [one for one in kept if one["fingerprint"] != here]
    RECORDED.write_text(json.dumps([*others, {"fingerprint": here, "digests": digests}], indent=2) + "\n")


if __name__ == "__main__":
    record()
