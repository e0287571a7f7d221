"""Plays many episodes of steady manoeuvres in a process of its own.

python -m tests.soak FAMILY EPISODES; says by how much resident memory grew.
"""

import sys
from contextlib import closing

import numpy as np
import psutil

from risk_sac.config import FamilyName
from risk_sac.env.env import make_default

SEED = 404  # libsumo used to read freed memory in the 47th episode of mixed
WARM_UP_EPISODES = 25


def main(family: FamilyName, episodes: int) -> None:
    generator, process, before = np.random.default_rng(SEED), psutil.Process(), 0
    with closing(make_default(family)) as env:
        for episode in range(episodes):
            env.reset(seed=SEED if episode == 0 else None)
            bias, done = generator.uniform(-1, 1, env.action_size), False
            while not done:
                action = np.clip(bias + 0.4 * generator.normal(size=env.action_size), -1, 1)
                _, _, terminated, truncated, _ = env.step(action.astype(np.float32))
                done = terminated or truncated
            if episode + 1 == WARM_UP_EPISODES:
                before = process.memory_info().rss
    print(f"grew {(process.memory_info().rss - before) / 2**20:.1f} MiB from {before / 2**20:.0f} MiB")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))  # type: ignore[arg-type]
