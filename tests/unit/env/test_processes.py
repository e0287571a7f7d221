"""One simulation in a process: second environments, lost ones, and child processes."""

import multiprocessing
import os
import subprocess
import sys
from contextlib import closing

import numpy as np
import pytest

from risk_sac.env.env import make_default
from risk_sac.errors import SimulationError
from tests.unit.env.episodes import episode, same


@pytest.fixture
def low():
    with closing(make_default("low")) as env:
        yield env


def test_the_package_alone_is_cheap_to_import():
    program = "import sys, risk_sac\nprint(sorted({'gymnasium', 'numpy', 'torch', 'pydantic'} & set(sys.modules)))"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert said.stdout == "[]\n"


def test_a_second_environment_of_a_process_is_refused_until_the_first_one_is_gone(low):
    expected = episode(low, 3)
    with closing(make_default("mixed")) as second:
        for _ in range(2):
            with pytest.raises(SimulationError, match=r"AsyncVectorEnv"):
                second.reset(seed=1)
        assert same(episode(low, 3), expected)
        low.close()
        second.reset(seed=1)
        with pytest.raises(SimulationError, match="call reset first"):
            low.step(low.action_space.sample())
        low.close()  # takes nothing from the other
        second.step(second.action_space.sample())
    assert same(episode(low, 3), expected)


def test_an_environment_that_is_lost_gives_way():
    lost = make_default("low")
    lost.reset(seed=1)
    lost.itself = lost  # a cycle
    del lost
    with closing(make_default("low")) as env:
        env.reset(seed=1)


def test_a_child_process_has_a_simulation_of_its_own(low):
    expected = episode(low, 3)
    low.reset(seed=3)

    def child():
        with closing(make_default("low")) as env:
            os._exit(0 if same(episode(env, 3), expected) else 1)

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    low.step(np.zeros(6, dtype=np.float32))
    process.join()
    assert process.exitcode == 0
    assert same(episode(low, 3), expected)
