"""Our box oracle against SUMO's list of collisions, for vehicles only.

SUMO measures along and across the lane and takes no account of a body's angle. Aligned bodies must meet in the same
step.
"""

from collections.abc import Iterator
from contextlib import closing

import libsumo
import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.limits import limits_from_odd
from risk_sac.sim.control import Adversaries
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import Frame
from tests.builders import Told, belief_of

LOW = FAMILIES["low"]


def listed(other: str) -> bool:
    """Whether SUMO lists a collision of the ego with another now."""
    return any({c.collider, c.victim} == {"ego", other} for c in libsumo.simulation.getCollisions())


@pytest.fixture
def blind() -> Iterator[SumoSimulation]:
    """The ego sees no other vehicle and so drives into them."""
    with closing(SumoSimulation(EgoConfig(), Told(lambda frame, _: belief_of(frame, frame.ids[1:])))) as simulation:
        yield simulation


def episode(sim: SumoSimulation, seed: int) -> Iterator[Frame]:
    """Frames of a random episode without steering, behind a standing leader."""
    generator = np.random.default_rng(seed)
    layout = LOW.layout(LOW.space.from_unit(generator.random(LOW.space.dimension)).values)
    frame = sim.reset(layout, seed)
    adversaries = Adversaries(LOW, limits_from_odd(LOW.odd, layout.friction), frame)
    sim.release()
    yield frame
    action = np.zeros(2 * len(LOW.adversaries))
    for _ in range(LOW.horizon_steps):
        action[::2] = np.clip(0.95 * action[::2] + 0.3 * generator.standard_normal(len(LOW.adversaries)), -1, 1)
        action[0] = -1.0
        adversaries.command(action.tolist(), frame, sim)
        frame = sim.step()
        yield frame


def test_aligned_vehicles_meet_in_the_step_in_which_sumo_says_so(blind: SumoSimulation) -> None:
    contacts = 0
    for seed in range(60):
        for frame in episode(blind, seed):
            if abs(np.sin(frame.heading_rad[0])) > 1e-3:
                break  # the ego changes lanes
            ours = {frame.ids[i + 1] for i in np.flatnonzero(relative_view(frame).overlap)}
            theirs = {other for other in frame.ids[1:] if listed(other)}
            if ours or theirs:
                contacts += 1
                assert ours == theirs, (seed, frame.time_s)
                break
        if contacts == 15:
            break
    assert contacts == 15
