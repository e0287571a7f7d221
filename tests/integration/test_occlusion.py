"""The mixed family contains the paper's Fig. 2: a truck in the adjacent lane hides a pedestrian from the ego."""

from contextlib import closing

import numpy as np

from risk_sac.env import make_default
from risk_sac.errors import InfeasibleScene
from risk_sac.types import STEP_S

SCENES, STEPS = 40, 80
HIDDEN_S = 0.5
NEAR_M, FAR_M = 3.0, 45.0  # between the ego and the pedestrian, along the road


def test_a_pedestrian_is_hidden_in_half_of_the_mixed_scenes_though_nobody_attacks() -> None:
    """For half a second or more while the ego comes near."""
    draw = np.random.default_rng(5)
    hidden = count = 0
    with closing(make_default("mixed")) as env:
        space, idle = env.problem.space, np.zeros(env.action_size, dtype=np.float32)
        for seed in range(SCENES):
            try:
                env.reset(seed=seed, options={"scene": space.from_unit(draw.random(space.dimension))})
            except InfeasibleScene:
                continue
            count += 1
            unseen = 0
            for _ in range(STEPS):
                *_, terminated, _, _ = env.step(idle)
                frame, seen = env.trace.frames[-1], env.trace.measures[-1].assessment.seen
                walker = frame.ids.index("pedestrian")
                ahead_m = frame.x_m[walker] - frame.x_m[0]
                unseen += bool(NEAR_M < ahead_m < FAR_M and not seen[walker - 1])
                if terminated:
                    break
            hidden += unseen * STEP_S >= HIDDEN_S - 1e-9
    print(f"hidden in {hidden} of {count} scenes")
    assert hidden >= 0.5 * count
