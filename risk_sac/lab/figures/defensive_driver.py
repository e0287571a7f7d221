"""Plays the defensive driver in undisturbed traffic beside SUMO's own.

    python -m risk_sac.lab.figures.defensive_driver OUT [--scenes 500] [--scenario mixed]

plays random scenes in which nothing attacks, each with SUMO's driver and with the profile `defensive` on top of it.
OUT is a CSV file with a line per scene; what it holds is not played again. A table is printed in the end.

Travel time: the time in which each of the two drives as far as the slower one comes within the horizon.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

from risk_sac.config import EgoConfig, FamilyName, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.world.types import STEP_S, Floats

FAMILIES: tuple[FamilyName, ...] = ("low", "mixed", "dense")
PROFILES = ("default", "defensive")
STANDING_MPS, MOVES_MPS = 0.1, 1.0
PATIENCE_STEPS = 600  # beyond the horizon, in which one that stands there has to set off
FIELDS = ("family", "seed", "profile", "time_s", "distance_m", "travel_s", "contact", "stands_for_ever")


def drive(env: RiskSacEnv, seed: int) -> tuple[Floats, str, bool]:
    """Plays a scene; returns metres driven, the actor touched, and if it stands for ever."""
    env.reset(seed=seed)
    idle, driven, contact = np.zeros(env.action_size, dtype=np.float32), [0.0], ""
    while True:
        _, _, touched, over, info = env.step(idle)
        driven.append(driven[-1] + env.trace.frames[-1].ego_speed_mps * STEP_S)
        if touched:
            contact = info["collision"].other_id
        if touched or over:
            break
    speed = env.trace.frames[-1].ego_speed_mps
    for _ in range(PATIENCE_STEPS):
        if contact or speed > STANDING_MPS:
            break
        _, _, touched, _, info = env.step(idle)
        if touched:
            contact = info["collision"].other_id
        speed = env.trace.frames[-1].ego_speed_mps
    env.close()  # libsumo runs one simulation at a time
    return np.array(driven), contact, not contact and speed <= STANDING_MPS


def rows_of(family: FamilyName, seed: int, environments: dict[str, RiskSacEnv]) -> list[dict[str, object]]:
    """Plays a scene with each driver."""
    played = {profile: drive(env, seed) for profile, env in environments.items()}
    common = min(driven[-1] for driven, _, _ in played.values())
    return [
        {
            "family": family,
            "seed": seed,
            "profile": profile,
            "time_s": round((len(driven) - 1) * STEP_S, 1),
            "distance_m": round(float(driven[-1]), 2),
            "travel_s": round(float(np.argmax(driven >= common - 1e-9)) * STEP_S, 1),
            "contact": contact,
            "stands_for_ever": int(for_ever),
        }
        for profile, (driven, contact, for_ever) in played.items()
    ]


def table(file: Path) -> str:
    """The figures by family, in Markdown."""
    with file.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    text = ["| family | scenes | driver | contacts | stands for ever | travel time, s |", "|---|---|---|---|---|---|"]
    for family in FAMILIES:
        for profile in PROFILES:
            here = [row for row in rows if (row["family"], row["profile"]) == (family, profile)]
            if here:
                contacts, standing = (sum(row[name] not in ("", "0") for row in here) for name in FIELDS[-2:])
                travel = np.mean([float(row["travel_s"]) for row in here])
                text.append(f"| {family} | {len(here)} | {profile} | {contacts} | {standing} | {travel:.2f} |")
    return "\n".join(text)


def main() -> None:
    """Plays what is missing, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--scenario", dest="family", choices=FAMILIES, action="append")
    options = parser.parse_args()
    done: set[tuple[str, str]] = set()
    if options.out.exists():
        with options.out.open(newline="") as lines:
            done = {(row["family"], row["seed"]) for row in csv.DictReader(lines)}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with options.out.open("a", newline="") as lines:
        writer = csv.DictWriter(lines, FIELDS)
        if not done:
            writer.writeheader()
        for family in options.family or FAMILIES:
            environments = {
                profile: RiskSacEnv.of(
                    RunSpec(family=family, method="no-adversary", seed=0, ego=EgoConfig(profile=profile))
                )
                for profile in PROFILES
            }
            for seed in range(options.scenes):
                if (family, str(seed)) not in done:
                    writer.writerows(rows_of(family, seed, environments))
                    lines.flush()
    print(table(options.out))


if __name__ == "__main__":
    main()
