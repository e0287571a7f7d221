"""Script model: predicts from a scene, a script and a belief about the ego how the episode ends.

Three perceptrons with two hidden layers of 256. Each has logits for: the episode fails; a reference driver would have
prevented it, which only helps training; it is a candidate for the headline; and, given that it fails, of which kind.

The belief is a distribution over the training egos: which of them the ego under test behaves like. It begins uniform
and follows by Bayes' rule from the episodes that were played.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from risk_sac.world.types import Floats, Vector

WIDTH, MEMBERS = 256, 3
TRUST = 0.7  # power of an episode's likelihood: the ego under test is none of the training egos
FAILS, PREVENTABLE, CANDIDATE = 0, 1, 2  # heads
HEADS = 3


class Prediction(NamedTuple):
    """Means over the members, for `n` points."""

    fails: NDArray[np.float32]  # n
    candidate: NDArray[np.float32]  # n
    kinds: NDArray[np.float32]  # n x K, of an episode that fails; sums to 1


class Member(nn.Module):
    """One perceptron; its dropout is for training alone."""

    def __init__(self, inputs: int, outputs: int, dropout: float = 0.0) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(inputs, WIDTH), nn.Linear(WIDTH, WIDTH)
        self.norms = nn.ModuleList([nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)])
        self.last, self.dropout = nn.Linear(WIDTH, outputs), nn.Dropout(dropout)

    def forward(self, points: torch.Tensor) -> torch.Tensor:
        """Returns logits, `n x outputs`, for points in the unit cube with a belief behind, `n x inputs`."""
        first = self.dropout(functional.silu(self.norms[0](self.first(2.0 * points - 1.0))))
        second = self.dropout(functional.silu(self.norms[1](self.second(first))))
        logits: torch.Tensor = self.last(second)
        return logits


Reflect = Callable[[Floats], Floats]
"""From points, `n x inputs`, to their mirror images."""


class ScriptModel:
    """Members, the variants that they tell apart as `kinds`, and the training egos.

    With `reflect`, a prediction is that of a point or of its mirror image, whichever fails more surely. Choice: not
    their mean. The training data strike from one side, so the mean would favour points where both neighbours strike.
    """

    def __init__(
        self, members: list[Member], kinds: tuple[str, ...], egos: tuple[str, ...], reflect: Reflect | None = None
    ) -> None:
        self.members, self.kinds, self.egos = members, kinds, egos
        self._reflect = reflect
        for member in members:
            member.eval()

    @property
    def inputs(self) -> int:
        """Numbers of a point."""
        return self.members[0].first.in_features - len(self.egos)

    def symmetric(self, reflect: Reflect) -> "ScriptModel":
        """Returns the same model, of which a point and its mirror image get the same prediction."""
        return ScriptModel(self.members, self.kinds, self.egos, reflect)

    def unknown(self) -> Floats:
        """Returns the belief about an ego of which nothing is known, `E`."""
        return np.full(len(self.egos), 1.0 / len(self.egos))

    def believe(self, belief: Floats, point: Floats, *, failed: bool) -> Floats:
        """Returns the belief after an episode of the ego: `point`, and whether it failed."""
        each = self.predict(np.repeat(point[None], len(self.egos), 0), np.eye(len(self.egos))).fails.astype(float)
        likelihood = (each if failed else 1.0 - each).clip(1e-3)
        weights: Floats = belief * likelihood**TRUST
        weights /= weights.sum()
        return weights

    @torch.no_grad()
    def predict(self, points: Floats | Vector, belief: Floats) -> Prediction:
        """Predicts for points in the unit cube, `n x inputs`.

        Args:
          points: to predict for.
          belief: about the ego, `E`, or one for each point, `n x E`.
        """
        if self._reflect is not None:
            sides = points, self._reflect(points.astype(np.float64))
            own, other = (self._predict(side, belief) for side in sides)
            taken = own.fails >= other.fails
            return Prediction(
                fails=np.where(taken, own.fails, other.fails),
                candidate=np.where(taken, own.candidate, other.candidate),
                kinds=np.where(taken[:, None], own.kinds, other.kinds),
            )
        return self._predict(points, belief)

    def _predict(self, points: Floats | Vector, belief: Floats) -> Prediction:
        """Predicts for the points themselves, without their mirror images."""
        beliefs = np.broadcast_to(belief, (len(points), len(self.egos)))
        inputs = torch.as_tensor(np.concatenate([points, beliefs], 1), dtype=torch.float32)
        logits = torch.stack([member(inputs) for member in self.members])
        heads = torch.sigmoid(logits[:, :, :HEADS]).mean(0).numpy()
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
        try:
            inputs = arrays["model.0.first.weight"].shape[1]
            members = []
            for i in range(MEMBERS):
                member = Member(inputs, HEADS + len(kinds))
                own = {name: arrays[f"model.{i}.{name}"] for name in member.state_dict()}
                member.load_state_dict(
                    {name: torch.from_numpy(value.astype(np.float32)) for name, value in own.items()}
                )
                members.append(member)
                if not all(np.isfinite(value).all() for value in own.values()):
                    raise ValueError("weights that are no finite numbers")
        except (KeyError, IndexError, RuntimeError) as error:
            raise ValueError(f"no script model with {len(kinds)} kinds: {error}") from error
        return cls(members, kinds, egos)
