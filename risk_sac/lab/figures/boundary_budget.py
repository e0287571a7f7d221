"""Compares the episodes of a boundary search with those of a full grid.

    python -m risk_sac.lab.figures.boundary_budget FOLDER OUT [--only CASE ...] [--episodes N ...] [--no-play]

FOLDER has the OpenSCENARIO files of ALKS and Euro NCAP, anywhere below it. For each case and ego it plays a grid of
20 x 20 scenes into OUT/grid_CASE_EGO.csv, or goes on with it. The method's sampler then seeks the boundary among the
grid's scenes, by their outcomes. OUT/budget.csv has its agreement with the grid; `agreement_elsewhere` is that with the
scenes which it did not ask for.
"""

import argparse
import csv
from collections.abc import Mapping, Sequence
from contextlib import closing
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.config import RunSpec, SceneOptimizerConfig
from risk_sac.config.campaign import BoundaryConfig
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import InfeasibleScene
from risk_sac.lab.figures.pretrained_policy import ego_of
from risk_sac.lab.figures.side_by_side import Row, write_rows
from risk_sac.openscenario.scenario_file import import_scenario
from risk_sac.records import Ending, Outcome
from risk_sac.scenario import library
from risk_sac.scenario.declared import Slice
from risk_sac.search.encounter import Encounter
from risk_sac.search.level_set import FailureClassifier
from risk_sac.search.loop import episode_seed
from risk_sac.search.scene_optimizer import BoundarySampler
from risk_sac.world.types import Bools, Scene

SIDE, SEED = 20, 0  # of the grid
MARGIN = "no_contact"  # that carries the outcome of the grid to the sampler
EGOS = ("broken", "idm-aeb+weak-brakes")


class BudgetCase(NamedTuple):
    """A scenario, and the two parameters whose boundary is sought."""

    file: str
    over: Mapping[str, tuple[float, float]]
    values: Mapping[str, float] = {}  # of other parameters; the middle of their range where nothing is said


CASES = {
    "cut-in": BudgetCase(
        "alks_scenario_4_4_1_cut_in_no_collision_variation.xosc",
        {
            "CutInVehicle_HeadwayDistanceTrigger_dx0_m": (5.0, 35.0),
            "CutInVehicle_RelativeInitSpeed_Ve0_Vo0_kph": (-50.0, -15.0),
        },
        {"Ego_InitSpeed_Ve0_kph": 60.0, "CutInVehicle_LaneChange_MaxLateralVelocity_Vy_mps": 1.5},
    ),
    "pedestrian": BudgetCase("CPNA.xosc", {"Ego_speed_kph": (10.0, 80.0), "VRU_finalSpeed_kph": (3.0, 12.0)}),
    "slow car": BudgetCase("CCRs.xosc", {"Ego_speed_kph": (30.0, 130.0), "Target_init_speed_kph": (0.0, 50.0)}),
}


def kept_case(folder: Path, case: BudgetCase) -> tuple[str, BoundaryConfig]:
    """Imports a case's file and keeps it with the case's ranges; returns its name and the boundary's settings."""
    found = sorted(folder.rglob(case.file))
    scene = import_scenario(next((file for file in found if "StandardRange" in file.parts), found[0]))
    parameters = dict(scene.document.parameters)
    for name, (low, high) in case.over.items():
        own = parameters[name]
        parameters[name] = ScenarioParameter(unit=own.unit, meaning=own.meaning, range=(low, high))
    document = scene.document.model_copy(update={"parameters": parameters})
    return library.keep(document, scene.files), BoundaryConfig(over=tuple(case.over), at=case.values)


def rows_in(file: Path) -> list[Row]:
    """Reads the rows of a CSV file; none if it is not there."""
    if not file.exists():
        return []
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def play_grid(file: Path, name: str, config: BoundaryConfig, ego: str) -> list[Row]:
    """Plays the grid of a case into the file's rows, or goes on with it."""
    spec = RunSpec(family=name, method="story-random", seed=SEED, ego=ego_of(ego))
    played = rows_in(file)
    with closing(RiskSacEnv.of(spec)) as env:
        slice_ = Slice(env.problem.space, config, env.problem.family.parameters)
        sides = np.linspace(0.0, 1.0, SIDE)
        for number in range(len(played), SIDE * SIDE):
            unit = np.array([sides[number // SIDE], sides[number % SIDE]])
            scene = env.problem.space.from_unit(slice_.whole(unit, np.random.default_rng(number)))
            told = {name: scene.values[name] for name in config.over}
            played.append(told | outcome_of(env, scene, episode_seed(SEED, number)))
            write_rows(file, played)
    return played


def outcome_of(env: RiskSacEnv, scene: Scene, seed: int) -> Row:
    """Plays a scene to its end."""
    idle = np.zeros(env.action_size, dtype=np.float32)
    try:
        env.reset(seed=seed, options={"scene": scene})
    except InfeasibleScene as refused:
        return {"fails": "", "outcome": "rejected", "reason": refused.reason, "r157": "", "steps": 0}
    steps, ended = 0, False
    while not ended:
        _, _, terminated, truncated, info = env.step(idle)
        steps, ended = steps + 1, terminated or truncated
    ending = Ending.of(info.get("collision"), env.violations(env.requirement_results()))
    avoided = env.avoided_by() or {}
    return {
        "fails": int(ending.outcome is not Outcome.SAFE),
        "outcome": ending.outcome.value,
        "reason": ending.reason,
        "r157": int(not avoided["r157"]),
        "steps": steps,
    }


def search(rows: Sequence[Row], name: str, config: BoundaryConfig, episodes: int, seed: int) -> Row:
    """Seeks the boundary among the grid's scenes, whose outcomes are known; returns the agreement with all of them.

    What the method asks for is moved to the nearest scene of the grid, so a scene may be asked for twice.
    """
    problem = Problem.from_spec(RunSpec(family=name, method="boundary", seed=seed, boundary=config))
    slice_ = Slice(problem.space, config, problem.family.parameters)
    sampler = BoundarySampler(problem.space.dimension, SceneOptimizerConfig(), seed, slice_)
    sides, asked = np.linspace(0.0, 1.0, SIDE), list[int]()
    truth = np.array([row["fails"] in (1, "1") for row in rows])
    played = np.array([row["fails"] != "" for row in rows])
    for episode in range(episodes):
        levels = np.rint(sampler.ask()[list(slice_.columns)] * (SIDE - 1)).astype(int)
        asked.append(int(levels[0] * SIDE + levels[1]))
        told = slice_.whole(sides[levels], np.random.default_rng(episode))
        known, avoided = rows[asked[-1]], {}
        if known["r157"] != "":
            avoided = {"r157": not int(known["r157"])}
        margins = {MARGIN: -1.0 if truth[asked[-1]] else 1.0}
        sampler.tell(told, 0.0 if played[asked[-1]] else None, Encounter(margins=margins, avoided_by=avoided))
    units = np.array([[sides[number // SIDE], sides[number % SIDE]] for number in range(len(rows))])
    known_at = [number for number in asked if played[number]]
    classifier = FailureClassifier(units[known_at], truth[known_at])
    guessed = classifier.probability(units) > 0.5
    new = played.copy()
    new[asked] = False
    return {
        "grid": int(played.sum()),
        "fails": round(float(truth[played].mean()), 3),
        "seed": seed,
        "episodes": episodes,
        "agreement": round(balanced(guessed[played], truth[played]), 3),
        "agreement_elsewhere": round(balanced(guessed[new], truth[new]), 3),
    }


def balanced(guessed: Bools, truth: Bools) -> float:
    """Mean of the shares of failing and of passing scenes that are guessed right."""
    return float((guessed[truth].mean() + (~guessed[~truth]).mean()) / 2)


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="+", choices=list(CASES), default=list(CASES), metavar="CASE")
    parser.add_argument("--episodes", nargs="+", type=int, default=[80], help="of a search (default: 80)")
    parser.add_argument("--seeds", type=int, default=3, help="searches of each case and ego (default: 3)")
    parser.add_argument("--no-play", action="store_true", help="leave out the grids that are not complete")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for ego, case in product(EGOS, options.only):
        name, config = kept_case(options.folder, CASES[case])
        file = options.out / f"grid_{case.replace(' ', '-')}_{ego}.csv"
        grid = rows_in(file) if options.no_play else play_grid(file, name, config, ego)
        if len(grid) < SIDE * SIDE:
            continue
        searched = config.model_copy(update={"requirement": MARGIN})
        for episodes, seed in product(options.episodes, range(options.seeds)):
            rows.append({"case": case, "ego": ego} | search(grid, name, searched, episodes, seed))
            write_rows(options.out / "budget.csv", rows)
            print(*rows[-1].values(), sep=",", flush=True)


if __name__ == "__main__":
    main()
