"""Measures what SUMO's drivers do in undisturbed scenes, and writes what plausibility is calibrated on.

    python -m risk_sac.lab.figures.undisturbed_behaviour OUT [--scenes 2000] [--family mixed] [--ship]

plays random scenes in which nothing attacks. OUT/FAMILY.jsonl has a line per scene; what it holds is not played again.
`--ship` makes `risk_sac/verdicts/undisturbed.json` of the scenes with even seeds and checks it on the odd ones.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from risk_sac.config import FamilyName, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.verdicts.behaviour import observed_of

FAMILIES: tuple[FamilyName, ...] = ("low", "mixed", "dense")


def observe(env: RiskSacEnv, seed: int) -> str:
    """Plays a scene; returns the line with the features of its adversaries."""
    env.reset(seed=seed)
    idle, over, contact = np.zeros(env.action_size, dtype=np.float32), False, ""
    while not (over or contact):
        _, _, _, over, info = env.step(idle)
        contact = info["collision"].other_id if "collision" in info else ""
    observed = [(each.actor, each.feature, round(each.value, 4)) for each in observed_of(env.evidence())]
    return json.dumps({"seed": seed, "contact": contact, "observed": observed})


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--family", choices=FAMILIES, action="append")
    options = parser.parse_args()
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
