"""Plays methods × defects × seeds, each up to its first detection or the end of its budget.

OUT/<defects>-<version>-<run>-<steps>/   a run's folder, with its `detection.json` once it has ended
"""

import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from risk_sac.benchmark.detection import ANSWER, Detection, first_detection
from risk_sac.config import EgoConfig, MethodName, RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.egos.registry import pinned
from risk_sac.errors import ConfigError
from risk_sac.problem import check_installed


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """Methods and the defects on which they are compared."""

    methods: tuple[MethodName, ...]
    defects: tuple[str, ...]
    seeds: tuple[int, ...]
    budget_steps: int

    def __post_init__(self) -> None:
        """Refuses a method or defect that does not exist.

        Raises:
          ConfigError: naming it.
        """
        for method in self.methods:
            check_installed(method)
        for name in self.defects:
            pinned(ego_with(name))

    def specs(self) -> Iterator[RunSpec]:
        """Seeds outermost and methods innermost, so that early results compare methods."""
        for seed in self.seeds:
            for name in self.defects:
                for method in self.methods:
                    yield RunSpec(
                        family=DEFECTS[name].families[0], method=method, seed=seed, ego=pinned(ego_with(name))
                    )


def ego_with(defect: str) -> EgoConfig:
    """Returns a defect's base ego with the defect; a name that no defect has is refused when the ego is pinned."""
    base = DEFECTS[defect].base if defect in DEFECTS else "idm-aeb"
    return read_ego(f"{base}+{defect}")


def folder_of(spec: RunSpec, out: Path, budget_steps: int) -> Path:
    """Returns the folder of a run, which is another one for each version of its ego."""
    version = (spec.ego.version or "").replace("+", "-")
    return out / "-".join((*spec.ego.defects, version, spec.id, str(budget_steps)))


def play(benchmark: Benchmark, out: Path, jobs: int) -> Iterator[Detection]:
    """Yields the outcomes of all runs as they end, those that have ended before at first.

    Args:
      benchmark: what to play.
      out: folder of the runs; the same call goes on with what is in it.
      jobs: processes that work at a time.
    """
    if jobs < 1:
        raise ConfigError("jobs", f"{jobs}", "at least one process")
    waiting = []
    for spec in benchmark.specs():
        folder = folder_of(spec, out, benchmark.budget_steps)
        if (folder / ANSWER).exists():
            yield first_detection(spec, folder, benchmark.budget_steps)
        else:
            waiting.append((spec, folder))
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        try:
            pending = [pool.submit(first_detection, *each, benchmark.budget_steps) for each in waiting]
            for ended in as_completed(pending):
                yield ended.result()
        finally:  # of the rest nothing begins
            pool.shutdown(wait=False, cancel_futures=True)
