"""Compares scripts in uniformly drawn scenes: chosen, random and best.

    python -m risk_sac.lab.figures.uniform_scenes OUT --egos NAME ... [--scenario NAME ...] [--drivers NAME ...]
        [--scenes N] [--scripts N]

plays each driver before each ego, and rewrites OUT/scenes.csv after each. All meet the same scenes, and nothing is
learnt. `any` plays up to N scripts in a scene until one leads to a plausible failure, half of them random and half
mutated from the library. So its failures are the ceiling of what scripts can reach there. A scenario without a library
has random scripts alone. `low` and `high` are Wilson's 95 % interval of the share of plausible failures.
"""

import argparse
from collections.abc import Iterator
from contextlib import closing, suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.config import RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.lab.figures.pretrained_policy import ego_of
from risk_sac.lab.figures.side_by_side import Row, rows_of
from risk_sac.lab.pretraining.episodes import play
from risk_sac.metrics import wilson_interval
from risk_sac.records import Collision, Violation
from risk_sac.scenario.reading import PAPER_FAMILIES, shipped_names
from risk_sac.search.agents.controls import ScriptFollower
from risk_sac.search.prior.start import PriorStart, start_of
from risk_sac.search.scene_optimizer.archive import mutated
from risk_sac.verdicts.distinct import variant_name
from risk_sac.world.types import Floats

DRIVERS = ("model", "random", "any")
SEED = 1302
CHOICE = 1024  # scripts among which the model chooses


class Matchup(NamedTuple):
    """One driver of adversaries before one ego."""

    family: str
    ego: str
    driver: str


def script(random: np.random.Generator, start: PriorStart, genes: int) -> Floats:
    """Draws a script: random, or a row of the library mutated by another one."""
    if not len(start.library):
        return random.random(genes)
    own, other = (start.library[random.integers(len(start.library))][-genes:] for _ in range(2))
    return random.random(genes) if random.random() < 0.5 else mutated(own, other, random)


def chosen(random: np.random.Generator, start: PriorStart, scene: Floats, genes: int) -> Floats:
    """Returns the script that the model holds to be worth most in a scene."""
    points = np.array([np.concatenate([scene, script(random, start, genes)]) for _ in range(CHOICE)])
    prediction = start.model.predict(points, start.belief)
    best: Floats = points[int((prediction.fails + 4.0 * prediction.candidate).argmax())][-genes:]
    return best


def outcomes(cell: Matchup, scenes: int, scripts: int) -> Iterator[Collision | Violation | None]:
    """Yields a scene's valid violation; unplayable scenes are drawn again.

    Of several scripts the first with a plausible violation counts, or else the last with any. An episode in which the
    ego fails to answer has none.
    """
    spec = RunSpec(family=cell.family, method="archive", seed=SEED, ego=ego_of(cell.ego))
    drawn, random = np.random.default_rng(SEED), np.random.default_rng((SEED, 1))
    with closing(RiskSacEnv.of(spec)) as env:
        space, horizon = env.problem.space, env.problem.family.horizon_steps
        follower, start = ScriptFollower(env.problem.family), start_of(env.problem, "shipped")
        while scenes:
            scene, seed, violation = drawn.random(space.dimension), int(drawn.integers(1 << 30)), None
            try:
                env.reset(seed=seed, options={"scene": space.from_unit(scene)})
            except InfeasibleScene:
                continue
            for _ in range(scripts if cell.driver == "any" else 1):
                if cell.driver == "model":
                    genes = chosen(random, start, scene, follower.genes)
                elif cell.driver == "random":
                    genes = random.random(follower.genes)
                else:
                    genes = script(random, start, follower.genes)
                with suppress(EgoFailed):
                    violation = play(env, follower, space.from_unit(scene), genes, seed, horizon)[0].worst or violation
                if violation is not None and violation.plausible:
                    break
            scenes -= 1
            yield violation


def row(scenes: int, scripts: int, cell: Matchup) -> Row:
    """Returns the figures of a driver before an ego."""
    failed = [violation for violation in outcomes(cell, scenes, scripts) if violation is not None]
    plausible = [violation for violation in failed if violation.plausible]
    low, high = wilson_interval(len(plausible), scenes)
    return cell._asdict() | {
        "scenes": scenes,
        "scripts": scripts if cell.driver == "any" else 1,
        "failures": len(failed),
        "plausible": len(plausible),
        "low": round(low, 3),
        "high": round(high, 3),
        "kinds": len({variant_name(violation) for violation in plausible}),
        "candidates": sum(violation.headline_candidate for violation in plausible),
    }


def main() -> None:
    """Plays, counts and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--egos", nargs="+", required=True, metavar="EGO", help="as pretrained_policy takes them")
    parser.add_argument("--scenario", dest="families", nargs="+", choices=shipped_names(), default=list(PAPER_FAMILIES))
    parser.add_argument("--drivers", nargs="+", choices=DRIVERS, default=list(DRIVERS))
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--scripts", type=int, default=500)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    cells = [Matchup(*cell) for cell in product(options.families, options.egos, options.drivers)]
    rows_of(partial(row, options.scenes, options.scripts), cells, options.jobs, options.out / "scenes.csv")
    print((options.out / "scenes.csv").read_text())


if __name__ == "__main__":
    main()
