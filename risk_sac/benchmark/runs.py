"""Plays methods × defects × seeds, each up to its first detection or the end of its budget.

OUT/<defects>-<version>-<run>/   a run's folder, with its `detection.json` once it has ended
"""

import logging
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from risk_sac.benchmark.detection import Detection, answer_of, first_detection
from risk_sac.config import EgoConfig, MethodName, RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.defects.catalogue import DEFECTS, version_of
from risk_sac.egos.registry import pinned
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.problem import check_installed

logger = logging.getLogger(__name__)


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
    """Returns a defect's base ego with the defect.

    A name that no defect has is refused when the ego is pinned.
    """
    base = DEFECTS[defect].base if defect in DEFECTS else "idm-aeb"
    return read_ego(f"{base}+{defect}")


def folder_of(spec: RunSpec, out: Path) -> Path:
    """Returns the folder of a run, which is another one for each version of its defects."""
    return out / "-".join((*spec.ego.defects, version_of(spec.ego), spec.id))


def ended(benchmark: Benchmark, out: Path) -> list[Detection]:
    """Returns the outcomes of the runs that have ended so far."""
    answers = (answer_of(folder_of(spec, out), benchmark.budget_steps) for spec in benchmark.specs())
    return [answer for answer in answers if answer is not None]


def play(benchmark: Benchmark, out: Path, jobs: int) -> Iterator[Detection]:
    """Plays the runs that have not ended so far, and yields their outcomes as they end.

    A run that fails is logged, and played again by the next call.

    Args:
      benchmark: what to play.
      out: folder of the runs; the same call goes on with what is in it.
      jobs: processes that work at a time.
    """
    if jobs < 1:
        raise ConfigError("jobs", f"{jobs}", "at least one process")
    runs = [(spec, folder_of(spec, out)) for spec in benchmark.specs()]
    waiting = [run for run in runs if answer_of(run[1], benchmark.budget_steps) is None]
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        try:
            pending = {pool.submit(first_detection, *run, benchmark.budget_steps): run[1] for run in waiting}
            for future in as_completed(pending):
                try:
                    yield future.result()
                except (RiskSacError, OSError) as error:
                    logger.warning("%s: %s", pending[future].name, error)
        finally:  # of the rest nothing begins
            pool.shutdown(wait=False, cancel_futures=True)
