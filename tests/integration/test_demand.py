"""Estimated memory of a run, beside what learner and checkpoint take."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from risk_sac.config import CampaignSpec, RunSpec
from risk_sac.config.campaign import MOST_BYTES, demand_bytes
from risk_sac.env.problem import Problem, checked_campaign
from risk_sac.errors import ConfigError

OBSERVATION, ACTION, HORIZON = 300, 8, 200  # wide, so that few transitions fill much
PROGRAM = f"""
import json, sys
from pathlib import Path
import numpy as np
import torch
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.transition import Transition
from risk_sac.config import METHODS, RunSpec
from risk_sac.run_folder import checkpoint

def live(spec):
    learner = Learner({OBSERVATION}, {ACTION}, METHODS[spec.method], spec.learner, 0)
    observation, action = np.ones({OBSERVATION}, np.float32), np.ones({ACTION}, np.float32)
    for step in range(min(spec.learner.replay.capacity, spec.budget.episodes * {HORIZON})):
        learner.observe(
            Transition(
                observation=observation, action=action, risk_reward=0.1, cost=0.1, robustness=0.5, next_robustness=0.4,
                next_observation=observation, terminated=False, accumulated_reward=float(step % 7),
            )
        )
    learner.update()
    checkpoint.save(Path(sys.argv[1]), {{"agent": learner.state()}}, "digest")

def memory(name):  # not getrusage: its maximum is inherited from the parent process
    (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(name)]
    return int(line.split()[1]) * 1024

torch.set_num_threads(1)
specs = [RunSpec.model_validate(json.loads(text)) for text in sys.argv[2:]]
live(specs[0])  # what code and first calls take
before = memory("VmRSS")
live(specs[1])
print(memory("VmHWM") - before)
"""


def run(method: str = "risk-sac", *, episodes: int = 5, capacity: int = 1000, **agent: object) -> RunSpec:
    agent = {"hidden_sizes": [8], "batch_size": 8, "warmup_steps": 0, "decision_steps": 1, "device": "cpu"} | agent
    learner = {"agent": agent, "replay": {"capacity": capacity}}
    data = {"family": "low", "method": method, "seed": 0, "budget": {"episodes": episodes}, "learner": learner}
    return RunSpec.model_validate(data)


@pytest.mark.parametrize(
    "spec",
    [
        run(hidden_sizes=[1500, 1500]),
        run("ddpg-lag", hidden_sizes=[1500, 1500]),
        run("sac", episodes=300, capacity=50_000),
    ],
    ids=["networks", "networks of DDPG", "uniform replay"],
)
def test_the_estimate_is_within_a_factor_of_what_is_allocated(spec: RunSpec, tmp_path: Path) -> None:
    arguments = [str(tmp_path / "checkpoint"), run(spec.method).model_dump_json(), spec.model_dump_json()]
    said = subprocess.run([sys.executable, "-c", PROGRAM, *arguments], check=True, capture_output=True, text=True)
    demand = demand_bytes(spec, OBSERVATION, ACTION, HORIZON)
    estimate, allocated = sum(demand.values()) - demand["budget.episodes"], json.loads(said.stdout)
    assert allocated > 100 * 2**20
    assert 0.6 < estimate / allocated < 1.67, demand


def test_the_memory_holds_decisions() -> None:
    demands = [
        demand_bytes(run(episodes=30, capacity=100_000, decision_steps=steps), OBSERVATION, ACTION, 150)
        for steps in (1, 5, 7)
    ]
    rows = [each["learner.replay.capacity"] for each in demands]
    assert rows[0] == 5 * rows[1]
    assert rows[0] * 22 == 150 * rows[2]  # 150 / 7 is less than 22


def campaign(methods: list[str], **learner: object) -> CampaignSpec:
    data = {"families": ["low"], "methods": methods, "budget": {"episodes": 50_000}, "learner": learner}
    return CampaignSpec.model_validate(data)


@pytest.mark.parametrize(
    ("field", "learner"),
    [
        ("learner.agent.hidden_sizes", {"agent": {"hidden_sizes": [4096, 4096]}}),
        ("learner.replay.capacity", {"replay": {"capacity": 2_000_000}}),
    ],
)
def test_what_would_take_too_much_memory_is_refused_by_the_field_that_takes_most(field: str, learner: object) -> None:
    for methods in (["risk-sac"], ["random", "sac-lag"]):
        with pytest.raises(ConfigError, match="GiB of memory") as refusal:
            checked_campaign(campaign(methods, **learner))
        assert refusal.value.field == field
    checked_campaign(campaign(["random"], **learner))  # which has no networks
    with pytest.raises(ConfigError, match="GiB of memory"):
        Problem.from_spec(campaign(["ddpg"], **learner).runs()[0])


def test_the_defaults_take_a_small_part_of_the_most() -> None:
    spec = RunSpec(family="dense", method="risk-sac", seed=0)
    assert sum(demand_bytes(spec, 80, 10, HORIZON).values()) < MOST_BYTES / 10
