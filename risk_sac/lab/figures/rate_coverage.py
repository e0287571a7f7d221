"""Measures how often intervals of failure rates cover the true rate, and how wide they are.

    python -m risk_sac.lab.figures.rate_coverage OUT [--repetitions 500] [--plain 100000] [--ego-repetitions 50]
        [--egos NAME ...]

Three analytic problems, whose rate is exact, and two egos, whose rate plain draws tell. OUT has a CSV of each; what it
holds is not made again. OUT/coverage.csv compares with Wilson's interval of plain Monte Carlo with 20,000 draws.
"""

import argparse
import csv
import io
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import count
from pathlib import Path
from statistics import NormalDist, mean
from typing import NamedTuple

import numpy as np

from risk_sac.config import EgoConfig, RunSpec, SceneOptimizerConfig
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.metrics import wilson_interval
from risk_sac.rates.proposal import Stages, draws_of
from risk_sac.rates.record import estimated, stages_of
from risk_sac.records.rates import RateEstimate
from risk_sac.run_folder.durable import replace_file
from risk_sac.scenario import library
from risk_sac.scenario.reading import document_from
from risk_sac.search.encounter import NO_ENCOUNTER, Encounter
from risk_sac.search.loop import episode_seed
from risk_sac.search.scene_optimizer import RateSampler
from risk_sac.world.types import Floats

DRAWS, PLAIN_DRAWS = 2000, 20_000  # of an estimate, and of the plain Monte Carlo that it is compared with
TRUTH_SEED = 1_000_003
ROUND = 2000  # plain draws of a case before it is the other's turn; after them comes an estimate
_STANDARD = NormalDist()


class Analytic(NamedTuple):
    """A problem in standard normal space whose failure rate is known."""

    dimension: int
    margin: Callable[[Floats], float]  # failed at or below 0
    rate: float


PLANE, BALL, SIDES = 3.1, 4.3, 3.6
ANALYTIC: Mapping[str, Analytic] = {
    # One half-space across all axes.
    "plane": Analytic(8, lambda z: PLANE - float(z.sum()) / math.sqrt(8), 1.0 - _STANDARD.cdf(PLANE)),
    # Outside of a ball: all directions; P(χ² of 4 degrees > r²) = exp(-r²/2) (1 + r²/2).
    "ball": Analytic(4, lambda z: BALL - float(np.sqrt((z**2).sum())), math.exp(-(BALL**2) / 2) * (1 + BALL**2 / 2)),
    # Six half-spaces, one for each axis.
    "six-sides": Analytic(6, lambda z: SIDES - float(z.max()), 1.0 - _STANDARD.cdf(SIDES) ** 6),
}


# A short scenario with no adversary, since its rates need 300,000 episodes. The distributions are assumptions.
STANDING_CAR = """\
name: standing_car
summary: "Country road: the ego closes up on a car that stands in its lane."
network: rural
parameters:
  ego_speed_mps: {unit: m/s, range: [12, 26], meaning: initial speed of the ego,
    distribution: {kind: normal, mean: 18, deviation: 2}}
  time_gap_s: {unit: s, range: [2.5, 7], meaning: gap to the standing car over the ego's speed,
    distribution: {kind: normal, mean: 5, deviation: 0.5}}
  aside_m: {unit: m, range: [-0.8, 0.8], meaning: standing car's centre left of the lane's}
  friction: {unit: "1", range: [0.3, 1.0], meaning: tyre-road friction coefficient,
    distribution: {kind: normal, mean: 0.8, deviation: 0.1}}
ego: {start: {lane: eastbound_0, at_m: 400}, speed: ego_speed_mps}
actors:
  standing: {role: static, body: car, start: {ahead_of: ego, gap_m: time_gap_s * ego_speed_mps, left_m: aside_m}}
friction: friction
horizon_s: 8
"""
RATED_EGOS = {
    "r157": EgoConfig(driver="r157"),
    "idm-aeb+latency": EgoConfig(driver="idm-aeb", defects=("latency",)),
}


def rated_env(ego: EgoConfig) -> RiskSacEnv:
    """Returns the environment that plays scenes with the standing car."""
    scenario = library.keep(document_from(STANDING_CAR), {})
    return RiskSacEnv.of(RunSpec(family=scenario, method="rate", seed=0, ego=ego))


def repeated(problem: Analytic, seed: int) -> RateEstimate:
    """Estimates an analytic problem's rate with `DRAWS` draws."""
    stages, points, margins = Stages(problem.dimension, DRAWS, seed), list[Floats](), list[float]()

    def known() -> tuple[Sequence[Floats], Sequence[Mapping[str, float]], Sequence[bool]]:
        return points, [{"margin": margin} for margin in margins], [margin <= 0.0 for margin in margins]

    for number in range(DRAWS):
        points.append(stages.draw(number, lambda: draws_of(*known())))
        margins.append(problem.margin(points[-1]))
    draws = draws_of(*known())
    return estimated(stages.ratios(draws), stages.trust(DRAWS), draws.failed, np.ones(DRAWS, dtype=bool))


def play(env: RiskSacEnv, point: Floats, seed: int) -> Encounter | None:
    """Plays a scene without an attack; None where it is refused or the ego fails to drive."""
    idle = np.zeros(env.action_size, dtype=np.float32)
    info: dict[str, object] = {}
    try:
        env.reset(seed=seed, options={"scene": env.problem.space.from_unit(point)})
        for _ in range(env.problem.family.horizon_steps):
            _, _, terminated, truncated, info = env.step(idle)
            if terminated or truncated:
                break
    except (InfeasibleScene, EgoFailed):
        return None
    results = env.requirement_results()
    margins = {name: result.robustness for name, result in results.items() if result.counts == "failure"}
    return Encounter(collision=info.get("collision"), violations=env.violations(results), margins=margins)  # type: ignore[arg-type]


def plain(env: RiskSacEnv, start: int) -> Iterator[list[object]]:
    """Yields rows of plain draws from a number on: number, played, failed, least margin, and the point."""
    declared, size = env.problem.declared, env.problem.space.dimension
    for number in count(start):
        point = declared.unit(np.random.default_rng((TRUTH_SEED, number)).random(size))
        encounter = play(env, point, episode_seed(TRUTH_SEED, number))
        least = "" if encounter is None else f"{min(encounter.margins.values()):.4g}"
        failed = encounter is not None and bool(encounter.valid_violations)
        yield [number, int(encounter is not None), int(failed), least, *(f"{share:.5g}" for share in point)]


def estimated_with(env: RiskSacEnv, seed: int) -> RateEstimate:
    """Estimates an ego's rate with `DRAWS` draws."""
    problem, declared = env.problem, env.problem.declared
    sampler = RateSampler(problem.space.dimension, SceneOptimizerConfig(), seed, declared, DRAWS)
    for number in range(DRAWS):
        point = sampler.ask()
        encounter = play(env, point, episode_seed(seed, number))
        sampler.tell(point, None if encounter is None else 0.0, encounter or NO_ENCOUNTER)
    draws, stages = sampler.draws(), stages_of(declared, DRAWS, seed)
    played = np.asarray(np.isfinite(draws.margins).all(axis=1))
    return estimated(stages.ratios(draws), stages.trust(DRAWS), draws.failed, played)


def _rows(file: Path) -> list[list[str]]:
    """Reads the complete rows of a CSV without its header."""
    if not file.exists():
        return []
    return list(csv.reader(line for line in file.read_text().splitlines(keepends=True)[1:] if line.endswith("\n")))


def _add(file: Path, header: Sequence[str], rows: Iterator[Sequence[object]], most: int) -> None:
    """Appends rows until a file has so many."""
    done = _rows(file)
    if len(done) >= most:
        return
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *done])
    replace_file(file, text.getvalue().encode())  # without a row that an interruption cut off
    with file.open("a", newline="") as opened:
        writer = csv.writer(opened, lineterminator="\n")
        for _, row in zip(range(len(done), most), rows, strict=False):
            writer.writerow(row)
            opened.flush()


ESTIMATE = ("seed", "rate", "low", "high", "failures", "effective_failures", "why")


def _row(seed: int, estimate: RateEstimate) -> list[object]:
    return [seed, *("" if (value := getattr(estimate, name)) is None else value for name in ESTIMATE[1:])]


class IntervalCoverage(NamedTuple):
    """A row of the table."""

    problem: str
    rate: float  # exact, or of the plain draws
    plain_draws: int  # behind it; 0: it is exact
    repetitions: int
    estimated: int  # of these; the others say why not
    covered: float  # share of the intervals that contain the rate
    mean_ratio: float  # mean estimate over the rate
    width: float  # mean width of the intervals over that of Wilson's with 20,000 plain draws


def coverage(problem: str, rate: float, plain_draws: int, rows: Sequence[Sequence[str]]) -> IntervalCoverage:
    """Summarises repetitions."""
    told = [tuple(map(float, row[1:4])) for row in rows if row[1]]
    low, high = wilson_interval(round(rate * PLAIN_DRAWS), PLAIN_DRAWS)
    if not told:
        return IntervalCoverage(problem, rate, plain_draws, len(rows), 0, math.nan, math.nan, math.nan)
    return IntervalCoverage(
        problem,
        rate,
        plain_draws,
        len(rows),
        len(told),
        mean(one_low <= rate <= one_high for _, one_low, one_high in told),
        mean(estimate for estimate, _, _ in told) / rate,
        mean(one_high - one_low for _, one_low, one_high in told) / (high - low),
    )


def write_table(out: Path) -> None:
    """Writes OUT/coverage.csv of what is there."""
    table = [coverage(name, problem.rate, 0, _rows(out / f"{name}.csv")) for name, problem in ANALYTIC.items()]
    for name in RATED_EGOS:
        draws = _rows(out / f"plain-{name}.csv")
        played, failed = sum(row[1] == "1" for row in draws), sum(row[2] == "1" for row in draws)
        if failed:
            table.append(coverage(name, failed / played, played, _rows(out / f"rates-{name}.csv")))
    lines = [",".join(IntervalCoverage._fields)]
    lines += [",".join(f"{value:.4g}" if isinstance(value, float) else str(value) for value in row) for row in table]
    replace_file(out / "coverage.csv", ("\n".join(lines) + "\n").encode())
    print("\n".join(lines), flush=True)


def main() -> None:
    """Makes what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--repetitions", type=int, default=500)
    parser.add_argument("--plain", type=int, default=100_000)
    parser.add_argument("--ego-repetitions", type=int, default=50)
    parser.add_argument("--egos", nargs="+", choices=RATED_EGOS, default=list(RATED_EGOS), metavar="NAME")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault(library.VARIABLE, str(options.out / "scenarios"))
    for name, problem in ANALYTIC.items():
        file = options.out / f"{name}.csv"
        rows = (_row(seed, repeated(problem, seed)) for seed in range(len(_rows(file)), options.repetitions))
        _add(file, ESTIMATE, rows, options.repetitions)
    rounds = max(-(-options.plain // ROUND), options.ego_repetitions)
    for number, name in ((number, name) for number in range(1, rounds + 1) for name in options.egos):
        with closing(rated_env(RATED_EGOS[name])) as env:
            file = options.out / f"plain-{name}.csv"
            header = ("number", "played", "failed", "least_margin", *env.problem.space.names)
            _add(file, header, plain(env, len(_rows(file))), min(number * ROUND, options.plain))
            file = options.out / f"rates-{name}.csv"
            rows = (_row(seed, estimated_with(env, seed)) for seed in count(len(_rows(file))))
            _add(file, ESTIMATE, rows, min(number, options.ego_repetitions))
        write_table(options.out)
    write_table(options.out)


if __name__ == "__main__":
    main()
