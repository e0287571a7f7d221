"""A reference driver's verdict holds in SUMO with that driver in control.

The verdict moves boxes along recorded paths. Here SUMO moves the ego along its lanes and over its junctions at the
reference driver's speeds, while the striker goes where it was recorded.
"""

import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace

import libsumo
import numpy as np
import pytest

from risk_sac.config import EgoConfig, FamilyName
from risk_sac.env.env import RiskSacEnv, make_default
from risk_sac.records import Collision
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.search.agents.controls import RandomAgent
from risk_sac.sim.roads import STEERED
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.verdicts.conflict import Conflict, find_conflict
from risk_sac.verdicts.drivers import R157_PERCEIVES_S, full_braking, r157
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.reference import LEAD_M, reference_outcomes
from risk_sac.verdicts.rollout import STANDING_MPS
from risk_sac.world.geometry import Size, contact_point, relative_view, touches, zone
from risk_sac.world.types import STEP_S, Frame
from tests.builders import frame_of

EPISODES: dict[FamilyName, int] = {"low": 30, "mixed": 60, "dense": 30}  # so that each has contacts
FINE = 10  # looks between two steps
AGREE = 0.99

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Struck:
    """A contact of a random episode, valid or not."""

    layout: Layout
    evidence: Evidence
    striker: int
    conflict: Conflict
    collision: Collision


def contacts(env: RiskSacEnv, episodes: int) -> Iterator[Struck]:
    for seed in range(episodes):
        observation, _ = env.reset(seed=7000 + seed)
        agent = RandomAgent(env.action_size, seed)
        ended, info = False, {}
        while not ended:
            observation, _, terminated, truncated, info = env.step(agent.act(observation))
            ended = terminated or truncated
        if "collision" not in info:
            continue
        evidence = env.evidence()
        striker = evidence.column(info["collision"].other_id)
        conflict = find_conflict(evidence, striker)
        yield Struck(env.layout, evidence, striker, conflict, info["collision"])


def speeds(struck: Struck, driver: str) -> list[float]:
    """Speeds of the reference driver: recorded until it perceives, then its own."""
    evidence = struck.evidence
    perceives_s = R157_PERCEIVES_S if driver == "r157" else 0.0
    grip = evidence.ground.friction * GRAVITY_MPS2
    driven = evidence.speed_mps[: struck.conflict.frame + round(perceives_s / STEP_S) + 1, 0].tolist()
    tick = STEP_S / 100
    for step in range(80):
        speed = driven[-1]
        for k in range(100):
            braking = r157(step * STEP_S + (k + 0.5) * tick, grip) if driver == "r157" else full_braking(grip)
            speed = max(speed - braking * tick, 0.0)
        driven.append(speed)
    return driven


def pose(before: Frame, frame: Frame, share: float) -> Pose:
    """The ego's, between two frames."""
    turn = math.remainder(frame.heading_rad[0] - before.heading_rad[0], math.tau)
    x, y = (float(b[0] + share * (f[0] - b[0])) for b, f in ((before.x_m, frame.x_m), (before.y_m, frame.y_m)))
    return x, y, float(before.heading_rad[0] + share * turn)


def strikers_pose(struck: Struck, at: float) -> Pose:
    """Returns the striker's interpolated pose; after contact, at constant velocity."""
    e, column, last = struck.evidence, struck.striker, len(struck.evidence.time_s) - 1
    k = min(int(at), last)
    share, ahead_s = at - k, (at - last) * STEP_S
    x, y, heading = (a[:, column] for a in (e.x_m, e.y_m, np.unwrap(e.heading_rad, axis=0)))
    if k < last:
        return tuple(float(a[k] + share * (a[k + 1] - a[k])) for a in (x, y, heading))  # type: ignore[return-value]
    return (
        float(x[-1] + ahead_s * e.vx_mps[-1, column]),
        float(y[-1] + ahead_s * e.vy_mps[-1, column]),
        float(heading[-1]),
    )


def struck_side(
    ego: Pose, other: Pose, half_length: float, half_width: float, other_half_length: float, other_half_width: float
) -> str:
    x, y, heading = zip(ego, other, strict=True)
    length, width = (2 * half_length, 2 * other_half_length), (2 * half_width, 2 * other_half_width)
    both = frame_of(x_m=x, y_m=y, heading_rad=heading, length_m=length, width_m=width)
    return zone(*contact_point(relative_view(both)), half_length, half_width)


def avoids(sim: SumoSimulation, struck: Struck, driver: str) -> bool:
    """Returns whether the driver, with SUMO's ego, avoids causing the contact.

    It does not touch, stands when struck, or is struck from behind, and has not passed the place where the recorded
    ego was by then.
    """
    evidence = struck.evidence
    driven, last = speeds(struck, driver), len(evidence.time_s) - 1
    if struck.conflict.frame + round(R157_PERCEIVES_S / STEP_S) >= last and driver == "r157":
        return bool(evidence.speed_mps[-1, 0] <= STANDING_MPS)  # struck before it perceives
    frame = sim.reset(replace(struck.layout, vehicles=(), pedestrians=()), 1)
    libsumo.vehicle.setSpeedMode("ego", 0)
    libsumo.vehicle.setLaneChangeMode("ego", 0)
    for name, value in STEERED.items():
        libsumo.vehicle.setParameter("ego", f"laneChangeModel.{name}", value)
    half_length, half_width = float(frame.length_m[0]) / 2, float(frame.width_m[0]) / 2
    size = float(evidence.length_m[struck.striker]) / 2, float(evidence.width_m[struck.striker]) / 2
    way_m, recorded_m, aside_m = (
        0.0,
        *(
            np.concatenate(([0.0], np.cumsum(values[1:, 0]) * STEP_S))
            for values in (evidence.speed_mps, evidence.lateral_mps)
        ),
    )
    lead_m = 0.0
    for step, speed in enumerate(driven[1:], start=1):
        # Its path is kept, not its lateral speed: a slower actor moves aside later.
        to = np.interp((way_m, way_m + speed * STEP_S), recorded_m, aside_m)
        way_m += speed * STEP_S
        if step <= last:
            lead_m = way_m - recorded_m[step]
        libsumo.vehicle.setSpeed("ego", speed)
        libsumo.vehicle.changeSublane("ego", float(to[1] - to[0]))
        before, frame = frame, sim.step()
        for k in range(1, FINE + 1):
            ego, other = pose(before, frame, k / FINE), strikers_pose(struck, step - 1 + k / FINE)
            if touches(ego, Size(half_length, half_width), other, Size(*size)):
                rear = struck_side(ego, other, half_length, half_width, *size) == "rear"
                return (speed <= STANDING_MPS or rear) and lead_m <= LEAD_M
        if speed <= STANDING_MPS and step > struck.conflict.frame:
            lead_m = way_m - recorded_m[last] if step < last else lead_m
            break
    return lead_m <= LEAD_M


@pytest.mark.parametrize("family", EPISODES)
def test_verdicts_are_those_of_the_driver_at_the_wheel(family: FamilyName) -> None:
    with closing(make_default(family)) as env:
        found = list(contacts(env, EPISODES[family]))
    assert found
    with closing(SumoSimulation(EgoConfig())) as sim:
        pairs = [
            (
                avoids(sim, struck, driver),
                reference_outcomes(struck.evidence, struck.striker, struck.conflict)[driver].avoids,
            )
            for struck in found
            for driver in ("r157", "full_braking")
        ]
    assert sum(here == there for here, there in pairs) >= AGREE * len(pairs) - 1, pairs
