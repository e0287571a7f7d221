"""Makes updates of a SAC on a GPU as one CUDA graph.

Without it, Python starts some 300 kernels one by one.
"""

from dataclasses import fields

import torch
from torch import Tensor

from risk_sac.agents.agent import UpdateResult
from risk_sac.agents.replay import Batch
from risk_sac.agents.sac import SacAgent

WARM_UP = 3  # updates before the recording; in them torch sets up what may not be set up within


class GraphedUpdate:
    """Makes an agent's updates; they are the same as those of `SacAgent.update`.

    Batches must have the same size. An agent that has loaded a state needs a new object.
    """

    def __init__(self, agent: SacAgent) -> None:
        """Records nothing yet; the agent must live on a GPU."""
        self._agent = agent
        self._made = 0
        self._graph: torch.cuda.CUDAGraph | None = None

    def __call__(self, batch: Batch) -> UpdateResult:
        """Makes one update with the risk reward of a batch, which lies on the CPU."""
        if self._made < WARM_UP:
            return self._warm_up(batch.on("cuda"))
        if self._graph is None:
            self._graph = self._recorded(batch.on("cuda"))
        for name, tensor in self._given.items():
            tensor.copy_(getattr(batch, name))
        self._graph.replay()
        return self._agent.result(*self._figures)

    def _warm_up(self, batch: Batch) -> UpdateResult:
        """Makes an update without a graph, on another stream, as torch asks for it."""
        self._made += 1
        stream = torch.cuda.Stream()  # type: ignore[no-untyped-call]
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            figures = self._agent.advance(batch, batch.risk_reward)
        torch.cuda.current_stream().wait_stream(stream)
        return self._agent.result(*figures)

    def _recorded(self, batch: Batch) -> torch.cuda.CUDAGraph:
        """Records an update, without making it; later batches are copied to the memory of this one."""
        self._given: dict[str, Tensor] = {f.name: getattr(batch, f.name) for f in fields(batch) if f.name != "indices"}
        graph = torch.cuda.CUDAGraph()
        graph.register_generator_state(self._agent.generator)
        with torch.cuda.graph(graph):
            self._figures = self._agent.advance(batch, batch.risk_reward)
        return graph
