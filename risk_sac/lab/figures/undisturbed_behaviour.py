"""Measures what SUMO's drivers do in undisturbed scenes, and writes what plausibility is calibrated on.

    python -m risk_sac.lab.figures.undisturbed_behaviour OUT [--scenes 2000] [--scenario mixed] [--ship]

plays random scenes in which nothing attacks. OUT/FAMILY.jsonl has a line per scene; what it holds is not played again.
`--ship` makes `risk_sac/verdicts/undisturbed.json` of the scenes with even seeds and checks it on the odd ones.
"""

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from risk_sac.config import FamilyName, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.records import PlausibilityClass
from risk_sac.risk.driving import FEATURES, LowerTail, UpperTail
from risk_sac.run_folder.durable import replace_file
from risk_sac.verdicts.behaviour import Observed, observed_of
from risk_sac.verdicts.plausibility import UNDISTURBED, Undisturbed, judge_observed

FAMILIES: tuple[FamilyName, ...] = ("low", "mixed", "dense")


PROBABILITIES = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
LEAST_BEYOND = 5  # values beyond a point of a tail, below which the point is noise
SCALES = np.arange(1.0, 3.01, 0.1)
WANTED = 0.01  # share of undisturbed scenes that may be less than ordinary


def observe(env: RiskSacEnv, seed: int) -> str:
    """Plays a scene; returns the line with the features of its adversaries."""
    env.reset(seed=seed)
    idle, over, contact = np.zeros(env.action_size, dtype=np.float32), False, ""
    while not (over or contact):
        _, _, _, over, info = env.step(idle)
        contact = info["collision"].other_id if "collision" in info else ""
    features = observed_of(env.evidence())
    observed = [(each.actor, each.feature, round(each.value, 4), round(each.time_s, 1)) for each in features]
    return json.dumps({"seed": seed, "contact": contact, "observed": observed})


def tail_of(values: Sequence[float]) -> tuple[list[float], list[float]]:
    """Describes the upper tail of a sample by points: values, ascending, and the shares of at least these."""
    sample = np.sort(values)
    points: dict[float, float] = {}
    for share in PROBABILITIES:
        if share * len(sample) >= LEAST_BEYOND or share == 1.0:
            value = float(sample[int(np.floor((1.0 - share) * len(sample)))])
            points.setdefault(round(value, 3), float((sample >= value).mean()))
    if len(points) == 1:  # all alike: a step beyond them is as rare as the sample can tell
        points[round(float(sample[-1]) + 1.0, 3)] = 1.0 / len(sample)
    return list(points), [round(share, 5) for share in points.values()]


def calibrated(scenes: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Computes what ships: the tails of the features without a published distribution, and the scale."""
    sampled: dict[str, list[float]] = defaultdict(list)
    half = list(scenes)
    for scene in half:
        for _, name, value, _ in scene["observed"]:
            if FEATURES[name].spread is None:
                sampled[name].append(value if FEATURES[name].unlikely == "above" else -value)
    tails = {name: tail_of(values) for name, values in sorted(sampled.items())}
    for scale in SCALES.tolist():
        judged = [judge_observed(*scene_of(scene), traffic_of(tails, scale)) for scene in half]
        if np.mean([each.joint_probability < WANTED for each in judged]) <= WANTED:
            break
    return {"scenes": len(half), "tails": tails, "scale": round(scale, 1)}


def traffic_of(tails: dict[str, tuple[list[float], list[float]]], scale: float) -> Undisturbed:
    """Returns the distributions as verdicts read them."""
    upper = {name: UpperTail(tuple(values), tuple(shares)) for name, (values, shares) in tails.items()}
    spreads = {n: tail if FEATURES[n].unlikely == "above" else LowerTail(tail) for n, tail in upper.items()}
    return Undisturbed(spreads, scale)


def scene_of(scene: dict[str, Any]) -> tuple[list[Observed], list[str]]:
    """Returns the features of a scene, and ids of its actors."""
    observed = [Observed(*each) for each in scene["observed"]]
    return observed, [f"actor {k}" for k in range(1 + max((each.actor for each in observed), default=0))]


def ship(out: Path) -> None:
    """Writes what verdicts are calibrated on, and prints how the other half is judged."""
    played = {family: _scenes(out / f"{family}.jsonl") for family in FAMILIES}
    shipped = calibrated(scene for scenes in played.values() for scene in scenes[::2])
    replace_file(UNDISTURBED, (json.dumps(shipped, indent=1) + "\n").encode())
    traffic = traffic_of(shipped["tails"], shipped["scale"])
    for family, scenes in played.items():
        classes = Counter(judge_observed(*scene_of(scene), traffic).verdict for scene in scenes[1::2])
        counts = ", ".join(f"{classes[name]} {name}" for name in PlausibilityClass)
        print(
            f"{family}: {len(scenes)} scenes, {sum(bool(s['contact']) for s in scenes)} contacts; unused half: {counts}"
        )


def _scenes(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text().splitlines() if line.endswith("}")]


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--scenario", dest="family", choices=FAMILIES, action="append")
    parser.add_argument("--ship", action="store_true", help="only make the file of what was played")
    options = parser.parse_args()
    if options.ship:
        ship(options.out)
        return
    options.out.mkdir(parents=True, exist_ok=True)
    for family in options.family or FAMILIES:
        file = options.out / f"{family}.jsonl"
        done = len(file.read_text().splitlines()) if file.exists() else 0
        env = RiskSacEnv.of(RunSpec(family=family, method="no-adversary", seed=0))
        with file.open("a") as lines:
            for seed in range(done, options.scenes):
                print(observe(env, seed), file=lines, flush=True)
        env.close()


if __name__ == "__main__":
    main()
