"""Plays the frozen policy in random scenes, beside random actions.

    python -m risk_sac.lab.figures.pretrained_policy [--scenario low …] [--policy FILE] [--episodes 60] EGO …

FILE is what `risk-sac pretrain` has written; without it, the shipped policy plays. An ego is `default`, a driver, or a
driver and a defect such as `idm-aeb+latency`.
"""

import argparse
from collections import Counter
from itertools import product
from pathlib import Path

from risk_sac.config import EgoConfig, RewardConfig
from risk_sac.egos.registry import pinned
from risk_sac.lab.pretraining.rollouts import Driver, Turn, play_turn
from risk_sac.scenario.reading import shipped_names
from risk_sac.search.frozen_policy import network
from risk_sac.search.prior.files import DATA
from risk_sac.search.prior.policy import POLICY, read_policy

EPISODES = 10  # of a turn


def ego_of(name: str) -> EgoConfig:
    """Returns the ego of a name as the command takes it."""
    driver, *defects = name.split("+")
    return pinned(EgoConfig() if name == "default" else EgoConfig(driver=driver, defects=tuple(defects)))


def main() -> None:
    """Prints a row for each scenario, ego and driver."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("egos", nargs="+", metavar="EGO")
    parser.add_argument("--scenario", dest="families", nargs="+", choices=shipped_names(), default=["low"])
    parser.add_argument("--policy", type=Path, metavar="FILE")
    parser.add_argument("--drivers", nargs="+", choices=("policy", "random"), default=("policy", "random"))
    parser.add_argument("--seed", type=int, default=301)
    parser.add_argument("--episodes", type=int, default=60)
    options = parser.parse_args()
    drivers: dict[str, Driver] = {"random": None}
    if "policy" in options.drivers:
        pretrained = read_policy(options.policy or DATA / POLICY)
        drivers["policy"] = network(pretrained.policy), network(pretrained.critics)
    print("| scenario | ego | driven by | failures | distinct | candidates, distinct | attackers | steps |")
    print("|---" * 8 + "|")
    for family, name, drives in product(options.families, options.egos, options.drivers):
        rest = EPISODES, drivers[drives], RewardConfig(), False
        turns = [
            Turn(family, ego_of(name), name, (options.seed, turn), *rest)
            for turn in range(options.episodes // EPISODES)
        ]
        played = [episode for turn in turns for episode in play_turn(turn)]
        failed = [each for each in played if each.kind]
        kinds, candidates = {each.kind for each in failed}, {each.kind for each in failed if each.candidate}
        attackers = sorted(Counter(each.attacker for each in failed).items())
        counts = f"{len(failed)} of {len(played)} | {len(kinds)} | {len(candidates)} | {attackers}"
        print(f"| {family} | `{name}` | {drives} | {counts} | {sum(each.steps for each in played)} |", flush=True)


if __name__ == "__main__":
    main()
