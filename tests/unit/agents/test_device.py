import pytest
import torch

from risk_sac.agents.agent import Agent
from risk_sac.agents.device import choose_device, random_batch
from risk_sac.agents.sac import SacAgent
from risk_sac.config import AgentConfig, SacConfig
from risk_sac.errors import ConfigError

CONFIG = AgentConfig(hidden_sizes=(8,), batch_size=16)
BATCH = random_batch(3, 2, 16)


def make(device: str) -> Agent:
    return SacAgent(3, 2, CONFIG, SacConfig(), 0, device)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU here")
def test_without_a_gpu_the_processor_is_taken_unless_a_gpu_was_asked_for() -> None:
    assert choose_device("auto", make, BATCH) == "cpu"
    assert choose_device("cpu", make, BATCH) == "cpu"
    with pytest.raises(ConfigError, match="CUDA") as caught:
        choose_device("cuda", make, BATCH)
    assert caught.value.field == "learner.agent.device"


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_an_agent_on_the_gpu_learns_what_one_on_the_processor_learns() -> None:
    assert choose_device("auto", make, BATCH) in ("cpu", "cuda")
    slow, fast = make("cpu"), make("cuda")
    fast.load(slow.state() | {"generator": fast.state()["generator"]})
    batches = BATCH, BATCH.on("cuda")
    results = [agent.update(batch, batch.risk_reward) for agent, batch in zip((slow, fast), batches, strict=True)]
    assert results[1].td_errors.shape == results[0].td_errors.shape
    assert results[1].critic_loss == pytest.approx(results[0].critic_loss, rel=0.5)  # their noise differs


def test_batches_stay_where_they_are_on_the_processor() -> None:
    assert BATCH.on("cpu") is BATCH
