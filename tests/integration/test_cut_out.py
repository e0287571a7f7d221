"""Cut-out of UN R157: a leader hides a standing car, leaves late."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.observation_layout import X_M, Y_M
from risk_sac.records import Collision
from risk_sac.search.agents.controls import ScriptFollower
from risk_sac.search.scripts import Genes
from risk_sac.world.types import Frame

LEAVES = Genes(active=1.0, place=0.9, aside=1.0, cue=0.7, drive=0.9, steer=0.0, lasts=1.0, after=0.5)  # to the right


@pytest.fixture(scope="module", params=[(), ("late-tracks",)], ids=["sound", "late-tracks"])
def env(request: pytest.FixtureRequest) -> Iterator[RiskSacEnv]:
    ego = EgoConfig(driver="idm-aeb", defects=request.param)
    with closing(RiskSacEnv.of(RunSpec(family="motorway_cut_out", method="archive", seed=1, ego=ego))) as environment:
        yield environment


def played(env: RiskSacEnv, *, left: bool) -> tuple[list[Frame], Collision | None]:
    """Plays a fast scene; the leader leaves to the free side."""
    space, follower = env.problem.space, ScriptFollower(env.problem.family)
    unit = np.full(space.dimension, 0.5)
    unit[space.names.index("ego_speed_mps")] = 1.0
    unit[space.names.index("side")] = 0.75 if left else 0.25  # of the vehicle beside: on the right from 0.5
    follower.begin(np.array(LEAVES._replace(steer=1.0 if left else 0.0)))
    observation, _ = env.reset(seed=3, options={"scene": space.from_unit(unit)})
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(follower.act(observation))
        ended = terminated or truncated
    return env.trace.frames, info.get("collision")


def test_the_observation_tells_where_the_standing_car_is(env: RiskSacEnv) -> None:
    for seed in (1, 2):
        observation, _ = env.reset(seed=seed)
        frame = env.trace.frames[-1]
        standing, heading = frame.ids.index("standing"), frame.heading_rad[0]
        dx, dy = frame.x_m[standing] - frame.x_m[0], frame.y_m[standing] - frame.y_m[0]
        ahead_m, aside_m = dx * np.cos(heading) + dy * np.sin(heading), dy * np.cos(heading) - dx * np.sin(heading)
        assert observation[-3:-1] * (X_M, Y_M) == pytest.approx((ahead_m, aside_m), abs=1e-3)


@pytest.mark.parametrize("left", [False, True])
def test_a_cut_out_reveals_a_standing_car_that_an_ego_with_late_tracks_hits(env: RiskSacEnv, left: bool) -> None:
    frames, collision = played(env, left=left)
    lead, standing = (frames[0].ids.index(name) for name in ("lead", "standing"))
    aside_m = np.array([frame.y_m[lead] - frame.y_m[standing] for frame in frames])
    ahead_m = np.array([frame.x_m[standing] - frame.x_m[lead] for frame in frames])
    passes = int((ahead_m < 0.0).argmax())
    assert 1.85 < aside_m[passes] * (1.0 if left else -1.0) < 3.5  # in the lane beside
    late_s = ahead_m[np.abs(aside_m) < 0.4].min() / frames[0].speed_mps[lead]
    assert late_s < 3.0
    if not env.problem.ego.defects:
        assert collision is None
    else:
        assert collision is not None
        assert (collision.other_id, collision.valid) == ("standing", True)
        assert passes < len(frames) - 1
