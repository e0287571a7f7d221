"""Updates of the pretraining's learner as one CUDA graph and by kernels."""

from collections.abc import Callable
from time import perf_counter

import numpy as np
import pytest
import torch

from risk_sac.lab.pretraining.policy import AGENT, REPLAY, SAC
from risk_sac.search.agents.replay import UniformReplay
from risk_sac.search.agents.sac import GraphedUpdate, SacAgent
from tests.unit.search.agents.test_graphed import transition

SIZES, STORED, UPDATES, WANTED = (62, 4), 20_000, 400, 3.0


@pytest.mark.bench
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU with CUDA")
def test_a_graph_is_several_times_as_fast() -> None:
    random, replay = np.random.default_rng(1), UniformReplay(*SIZES, REPLAY)
    for _ in range(STORED):
        replay.add(transition(random, *SIZES))
    plain, graphed = (SacAgent(*SIZES, AGENT, SAC, 1, "cuda", normalised=True) for _ in range(2))
    by_graph = GraphedUpdate(graphed)

    def by_kernel() -> None:
        batch = replay.sample(AGENT.batch_size, random).on("cuda")
        plain.update(batch, batch.risk_reward)

    one, other = (milliseconds(call) for call in (by_kernel, lambda: by_graph(replay.sample(AGENT.batch_size, random))))
    print(
        f"\nAn update of the pretraining: {one:.2f} ms, as a CUDA graph {other:.2f} ms, {one / other:.1f} times as fast"
    )
    assert one / other >= WANTED


def milliseconds(call: Callable[[], object]) -> float:
    """Real time of a call, without the first few."""
    for _ in range(10):
        call()
    torch.cuda.synchronize()
    began = perf_counter()
    for _ in range(UPDATES):
        call()
    torch.cuda.synchronize()
    return 1e3 * (perf_counter() - began) / UPDATES
