"""Plays a family's frozen policy in random scenes, beside random actions.

    python -m risk_sac.lab.figures.pretrained_policy [--scenario low] [--policy FILE] [--seed 301] [--episodes 60] EGO …

FILE is what `risk-sac pretrain` has written; without it, the shipped policy plays. An ego is `default`, a driver, or a
driver and a defect such as `idm-aeb+latency`.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

from risk_sac.config import EgoConfig, RewardConfig
from risk_sac.egos.registry import pinned
from risk_sac.lab.pretraining.rollouts import PolicyEpisode, Turn, play_turn
from risk_sac.scenario.reading import PAPER_FAMILIES
from risk_sac.search.frozen_policy import Layers
from risk_sac.search.prior.policy import read_policy, shipped_policy

EPISODES = 10  # of a turn


def ego_of(name: str) -> EgoConfig:
    """Returns the ego of a name as the command takes it."""
    driver, *defects = name.split("+")
    return pinned(EgoConfig() if name == "default" else EgoConfig(driver=driver, defects=tuple(defects)))


def episodes(name: str, layers: Layers | None, options: argparse.Namespace) -> Iterator[PolicyEpisode]:
    """Plays whole turns before an ego; None as layers stands for random actions."""
    for turn in range(options.episodes // EPISODES):
        key = (options.seed, turn)
        yield from play_turn(Turn(options.family, ego_of(name), name, key, EPISODES, layers, RewardConfig()))


def main() -> None:
    """Prints a row for each ego and driver."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("egos", nargs="+", metavar="EGO")
    parser.add_argument("--scenario", dest="family", choices=PAPER_FAMILIES, default="low")
    parser.add_argument("--policy", type=Path, metavar="FILE")
    parser.add_argument("--seed", type=int, default=301)
    parser.add_argument("--episodes", type=int, default=60)
    options = parser.parse_args()
    pretrained = read_policy(options.policy) if options.policy else shipped_policy(options.family)
    if pretrained is None:
        parser.error(f"--scenario: {options.family} has no shipped policy")
    layers = [layer[0] if layer.shape[1] > 1 else layer[0, 0] for layer in pretrained.policy]
    print("| ego | driven by | failures | distinct | candidates, distinct | steps |\n|---|---|---|---|---|---|")
    for name in options.egos:
        for driver, network in (("policy", layers), ("random", None)):
            played = list(episodes(name, network, options))
            failed = [each for each in played if each.kind]
            kinds, candidates = {each.kind for each in failed}, {each.kind for each in failed if each.candidate}
            steps = sum(each.steps for each in played)
            print(
                f"| `{name}` | {driver} | {len(failed)} of {len(played)} | {len(kinds)} | {len(candidates)} | {steps} |"
            )


if __name__ == "__main__":
    main()
