"""Script model: predicts an episode's end from the point's tokens.

It takes a belief about the ego, too.

Its members share their weights over the actors, which are a set: any number of any bodies, in any order. The second
round of a member sees what the first has pooled over all actors. Each has logits for: the episode fails; a reference
driver would have prevented it, which only helps training; it is a candidate for the headline; and, given that it
fails, of which kind. A prediction is the mean over the members, and over the point and its mirror image.

The belief is a distribution over the training egos: which of them the ego under test behaves like. It begins uniform
and follows by Bayes' rule from the episodes that were played.

Source of the sets: Zaheer et al., "Deep Sets" (NeurIPS 2017).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.functional import silu

from risk_sac.search.prior.tokens import ACTOR_EVEN, ACTOR_ODD, SCENE_EVEN, SCENE_ODD, TokenBatch, Tokenizer
from risk_sac.search.scripts import SIZE
from risk_sac.world.types import Floats

WIDTH, MEMBERS = 128, 2
TRUST = 0.7  # power of an episode's likelihood: the ego under test is none of the training egos
FAILS, PREVENTABLE, CANDIDATE = 0, 1, 2  # heads
HEADS = 3
USUAL_ACTORS = 4.0  # by which sums over actors are divided
ABSENT = -1e4  # in a maximum over actors


class Prediction(NamedTuple):
    """Means over the members, for `n` points."""

    fails: NDArray[np.float32]  # n
    candidate: NDArray[np.float32]  # n
    kinds: NDArray[np.float32]  # n x K, of an episode that fails; sums to 1


class Tensors(NamedTuple):
    """Tokens and beliefs of `b` points as a member takes them."""

    scene: torch.Tensor  # b x scene entries
    actors: torch.Tensor  # b x n x (actor entries + 1 + SIZE)
    present: torch.Tensor  # b x n x 1
    belief: torch.Tensor  # b x E

    @classmethod
    def of(cls, batch: TokenBatch, belief: torch.Tensor) -> "Tensors":
        """Joins each actor's token with its script."""
        actors = np.concatenate([batch.actors, batch.scripts], axis=2)
        present = torch.from_numpy(batch.present)[:, :, None]
        return cls(torch.from_numpy(batch.scene), torch.from_numpy(actors), present, belief)


class Member(nn.Module):
    """Two rounds over the actors, each followed by pooling; its dropout is for training alone."""

    def __init__(self, egos: int, kinds: int, dropout: float = 0.0) -> None:
        super().__init__()
        self.scene = nn.Linear(SCENE_EVEN + SCENE_ODD + egos, WIDTH)
        self.actor = nn.Linear(ACTOR_EVEN + ACTOR_ODD + 1 + SIZE, WIDTH)
        self.shared, self.second = nn.Linear(WIDTH, WIDTH, bias=False), nn.Linear(WIDTH, WIDTH)
        self.pooled = nn.Linear(2 * WIDTH, WIDTH, bias=False)
        self.joined, self.last = nn.Linear(3 * WIDTH, WIDTH), nn.Linear(WIDTH, HEADS + kinds)
        self.norms = nn.ModuleList([nn.LayerNorm(WIDTH) for _ in range(4)])
        self.dropout = nn.Dropout(dropout)

    def forward(self, points: Tensors) -> torch.Tensor:
        """Returns logits, `b x (HEADS + kinds)`."""
        scene = silu(self.norms[0](self.scene(torch.cat([points.scene, points.belief], 1))))
        first = self.dropout(silu(self.norms[1](self.actor(points.actors) + self.shared(scene)[:, None])))
        pool = self.pooled(_pool(first, points.present))[:, None]
        second = self.dropout(silu(self.norms[2](self.second(first) + pool)))
        joined = torch.cat([_pool(second, points.present), scene], 1)
        logits: torch.Tensor = self.last(self.dropout(silu(self.norms[3](self.joined(joined)))))
        return logits


def _pool(actors: torch.Tensor, present: torch.Tensor) -> torch.Tensor:
    """Returns sum and maximum over the actors that are there, `b x 2 WIDTH`."""
    total = torch.where(present, actors, 0.0).sum(1) / USUAL_ACTORS
    most = torch.where(present, actors, ABSENT).amax(1)
    return torch.cat([total, torch.where(present.any(1), most, 0.0)], 1)


class ScriptModel:
    """Members, the variants that they tell apart as `kinds`, and the training egos."""

    def __init__(self, members: list[Member], kinds: tuple[str, ...], egos: tuple[str, ...]) -> None:
        self.members, self.kinds, self.egos = members, kinds, egos
        for member in members:
            member.eval()

    def unknown(self) -> Floats:
        """Returns the belief about an ego of which nothing is known, `E`."""
        return np.full(len(self.egos), 1.0 / len(self.egos))

    @torch.no_grad()
    def predict(self, batch: TokenBatch, belief: Floats) -> Prediction:
        """Predicts for points; one that cannot be played does not fail.

        Args:
          batch: tokens of the points, `n`.
          belief: about the ego, `E`, or one for each point, `n x E`.
        """
        beliefs = torch.tensor(np.broadcast_to(belief, (len(batch.scene), len(self.egos))), dtype=torch.float32)
        sides = [Tensors.of(side, beliefs) for side in (batch, batch.mirrored())]
        logits = torch.stack([member(side) for member in self.members for side in sides])
        heads = torch.sigmoid(logits[:, :, :HEADS]).mean(0).numpy() * batch.playable[:, None]
        kinds = torch.softmax(logits[:, :, HEADS:], 2).mean(0).numpy()
        return Prediction(heads[:, FAILS], heads[:, CANDIDATE], kinds)

    def arrays(self) -> dict[str, NDArray[np.float16]]:
        """Returns the weights as plain arrays, by name."""
        return {
            f"model.{i}.{name}": value.numpy().astype(np.float16)
            for i, member in enumerate(self.members)
            for name, value in member.state_dict().items()
        }

    @classmethod
    def from_arrays(
        cls, arrays: Mapping[str, NDArray[np.float16]], kinds: tuple[str, ...], egos: tuple[str, ...]
    ) -> "ScriptModel":
        """Builds the model that `arrays` made these of.

        Raises:
          ValueError: they are no script model of these kinds and egos.
        """
        members = []
        try:
            for i in range(MEMBERS):
                member = Member(len(egos), len(kinds))
                own = {name: arrays[f"model.{i}.{name}"].astype(np.float32) for name in member.state_dict()}
                member.load_state_dict({name: torch.from_numpy(value) for name, value in own.items()})
                members.append(member)
                if not all(np.isfinite(value).all() for value in own.values()):
                    raise ValueError("weights that are no finite numbers")
        except (KeyError, RuntimeError) as error:
            raise ValueError(f"no script model with {len(kinds)} kinds: {error}") from error
        return cls(members, kinds, egos)


class PlacedModel:
    """A script model at a problem; its points are the problem's own."""

    def __init__(self, model: ScriptModel, tokenizer: Tokenizer) -> None:
        self._model, self._tokenizer = model, tokenizer
        self.kinds, self.unknown, self.genes = model.kinds, model.unknown, tokenizer.genes

    def predict(self, points: Floats, belief: Floats) -> Prediction:
        """Predicts for points in the unit cube; see `ScriptModel.predict`."""
        return self._model.predict(self._tokenizer.batch(points), belief)

    def believe(self, belief: Floats, points: Floats, failed: NDArray[np.bool_]) -> Floats:
        """Returns the belief after episodes of the ego: their points, `n x d`, and which of them failed."""
        if not len(points):
            return belief
        egos = len(self._model.egos)
        beliefs = np.tile(np.eye(egos), (len(points), 1))
        each = self.predict(np.repeat(points, egos, 0), beliefs).fails.astype(float).reshape(-1, egos)
        likelihood = np.where(failed[:, None], each, 1.0 - each).clip(1e-3)
        logarithm = np.log(belief) + TRUST * np.log(likelihood).sum(axis=0)
        weights: Floats = np.exp(logarithm - logarithm.max())
        weights /= weights.sum()
        return weights
