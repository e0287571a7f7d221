"""Measures steps to a new fault's detection from three priors.

    python -m risk_sac.lab.figures.regression_prior OUT [--jobs N]

Version 1 is `idm-aeb` with one fault, version 2 is `idm-aeb` with another. Each version 1 is searched for 5,000 steps;
then each version 2 until its fault is detected. The same command goes on with an interrupted one; OUT/runs.csv has the
result.
"""

import argparse
import csv
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from functools import partial
from pathlib import Path
from statistics import mean

from risk_sac.config import Budget, FamilyName, RunSpec
from risk_sac.egos.registry import pinned
from risk_sac.execution.recorder import Recorder
from risk_sac.lab.benchmark.runs import Detection, ego_with, first_detection
from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.run_folder.results import RESULTS, read_results
from risk_sac.search.loop import execute_run
from risk_sac.search.prior.earlier import pinned_prior

# Family, faults of versions 1 and 2; np.random.default_rng(44) drew them from the catalogue's training part.
PAIRS: tuple[tuple[FamilyName, str, str], ...] = (
    ("low", "short-horizon", "blind-right"),
    ("low", "short-horizon", "late-braking"),
    ("mixed", "blind-right", "trucks-as-cars"),
    ("dense", "crossing-yields", "tailgates"),
)
SEEDS = (1, 2, 3)
CAMPAIGN_STEPS, MOST_STEPS, EPISODES = 5_000, 5_000, 2_000
ARMS = ("campaign", "shipped", "none")
Case = tuple[FamilyName, str, str, int, str]


class Until:
    """Observer that stops a run after so many steps."""

    def __init__(self, steps: float) -> None:
        self._steps, self._spent = steps, 0

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Counts the steps."""
        self._spent = record.environment_steps

    def should_stop(self) -> bool:
        """Whether the steps are spent."""
        return self._spent >= self._steps


def spec_of(family: FamilyName, fault: str, seed: int, prior: str) -> RunSpec:
    """Returns the spec of a search for a fault."""
    ego, budget = pinned(ego_with(fault)), Budget(episodes=EPISODES)
    return RunSpec(family=family, method="risk-sac-diverse", seed=seed, ego=ego, prior=prior, budget=budget)


def campaign(out: Path, family: FamilyName, fault: str, seed: int) -> Path:
    """Searches a version 1, unless that was done."""
    folder = out / f"{family}-{fault}-{seed}"
    metrics = read_results(folder).metrics if (folder / RESULTS).exists() else None
    if metrics is None or metrics.environment_steps < CAMPAIGN_STEPS:
        spec = spec_of(family, fault, seed, "shipped")
        recorder = Recorder(spec, folder, Until(CAMPAIGN_STEPS))
        recorder.finish(execute_run(spec, folder, recorder))
    return folder


def detection(out: Path, case: Case) -> Detection:
    """Searches a version 2."""
    family, before, after, seed, arm = case
    prior = arm
    if arm == "campaign":
        prior = pinned_prior(str(campaign(out, family, before, seed)), [family])
    folder = out / f"{family}-{before}-{after}-{seed}-{arm}"
    return first_detection(spec_of(family, after, seed, prior), folder, MOST_STEPS)


def rows(cases: Sequence[Case], detections: Sequence[Detection]) -> Iterator[dict[str, object]]:
    """Yields a row for each case."""
    for (family, before, after, seed, arm), case_detection in zip(cases, detections, strict=True):
        yield {
            "family": family,
            "version_1": before,
            "version_2": after,
            "seed": seed,
            "prior": arm,
            "detected": case_detection.detected,
            "triggered": case_detection.triggered,
            "steps": case_detection.steps,
            "driven_by": case_detection.episode.driven_by if case_detection.episode else None,
            "kind": case_detection.kind,
        }


def main() -> None:
    """Plays what is lacking and writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    cases: list[Case] = [(*pair, seed, arm) for seed in SEEDS for pair in PAIRS for arm in ARMS]
    firsts = dict.fromkeys((case[0], case[1], case[3]) for case in cases)  # two pairs may share one
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        campaigns = [pool.submit(campaign, options.out, *first) for first in firsts]
        others = [pool.submit(detection, options.out, case) for case in cases if case[-1] != "campaign"]
        wait(campaigns)
        wait(others)
        found = list(pool.map(partial(detection, options.out), cases))
    write(options.out / "runs.csv", cases, found)


def write(file: Path, cases: Sequence[Case], detections: Sequence[Detection]) -> None:
    """Writes the runs, and prints their summary."""
    told = list(rows(cases, detections))
    with file.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, told[0])
        writer.writeheader()
        writer.writerows(told)
    for arm in ARMS:
        times = [each.detected or MOST_STEPS for case, each in zip(cases, detections, strict=True) if case[-1] == arm]
        detected = sum(
            each.detected is not None for case, each in zip(cases, detections, strict=True) if case[-1] == arm
        )
        print(f"prior {arm}: detected {detected} of {len(times)}, restricted mean {mean(times):.0f} steps", flush=True)


if __name__ == "__main__":
    main()
