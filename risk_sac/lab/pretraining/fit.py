"""Fits a script model to script episodes."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from risk_sac.errors import ConfigError
from risk_sac.report.paired import vargha_delaney
from risk_sac.search.prior.script_model import CANDIDATE, FAILS, HEADS, MEMBERS, Member, ScriptModel
from risk_sac.search.prior.shipped import GRID, Prior

LIBRARY = 300  # points of a library, at most
LEAST_FAILURES = 50  # to fit a model to
KINDS, OTHER = 47, "another"  # the most frequent kinds that the model tells apart; the rest is one
HELD_OUT, BATCH, EPOCHS, PATIENCE = 0.1, 512, 40, 4
RATE, DECAY, DROPOUT = 1e-3, 1e-2, 0.1
CONCENTRATIONS = (1e-3, 0.03, 0.3, 3.0)  # of the beliefs in training: from an ego that is known to one that is not
Tensors = tuple[torch.Tensor, ...]  # points, heads, kinds, egos


@dataclass(frozen=True, slots=True)
class Dataset:
    """Script episodes of one family, as arrays."""

    points: NDArray[np.float32]  # n x inputs
    heads: NDArray[np.float32]  # n x HEADS, 0 or 1
    kinds: NDArray[np.str_]  # n; empty where it did not fail
    egos: NDArray[np.str_]

    @classmethod
    def read(cls, folder: Path, family: str) -> "Dataset":
        """Reads all files of a family."""
        points, heads, kinds, egos = [], [], [], []
        for path in sorted(folder.glob(f"{family}-*.npz")):
            with np.load(path, allow_pickle=False) as arrays:
                flags, kind = arrays["flags"], arrays["kind"]
                points.append(arrays["point"].astype(np.float32) / GRID)
                heads.append(np.stack([kind != "", flags[:, 0], flags[:, 1]], 1).astype(np.float32))
                kinds.append(kind)
                egos.append(arrays["ego"])
        return cls(np.concatenate(points), np.concatenate(heads), np.concatenate(kinds), np.concatenate(egos))


def fitted_prior(family: str, data: Dataset, seed: int) -> Prior:
    """Fits a family's script model and selects its library.

    Raises:
      ConfigError: too few episodes failed.
    """
    failed = int(data.heads[:, FAILS].sum())
    if failed < LEAST_FAILURES:
        remedy = "play more chunks"
        raise ConfigError("chunks", f"{failed} failures in {len(data.points)} episodes", f"{LEAST_FAILURES}", remedy)
    model, card = fit(data, seed)
    points, kinds = library_of(data, model)
    return Prior(family, model, points.astype(np.float64), kinds, card)


def fit(data: Dataset, seed: int) -> tuple[ScriptModel, dict[str, Any]]:
    """Fits a model; returns it with what it reaches on episodes held out."""
    frequent = [kind for kind, _ in Counter(data.kinds[data.kinds != ""].tolist()).most_common(KINDS)]
    names = (*frequent, OTHER)
    place = {kind: i for i, kind in enumerate(frequent)}
    kinds = torch.tensor([place.get(kind, len(frequent)) for kind in data.kinds.tolist()])
    points, heads = torch.from_numpy(data.points), torch.from_numpy(data.heads)
    egos, ego = np.unique(data.egos, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(points))
    size = int(HELD_OUT * len(order))
    held, own = torch.from_numpy(order[:size]), torch.from_numpy(order[size:])
    members, losses = [], []
    for i in range(MEMBERS):
        tensors = points, heads, kinds, torch.from_numpy(ego)
        member, loss = _fit_member(tensors, own, held, (len(names), len(egos)), seed + i)
        members.append(member)
        losses.append(loss)
    model = ScriptModel(members, names, tuple(egos.tolist()))
    prediction = model.predict(data.points[order[:size]], np.eye(len(egos))[ego[order[:size]]])
    blind = model.predict(data.points[order[:size]], model.unknown())
    truth = data.heads[order[:size]]
    failing = truth[:, FAILS] > 0
    card = {
        "episodes": len(points),
        "loss": losses,
        "auc_fails": auc(prediction.fails, failing),
        "auc_candidate": auc(prediction.candidate, truth[:, CANDIDATE] > 0),
        "auc_fails_unknown": auc(blind.fails, failing),
        "auc_candidate_unknown": auc(blind.candidate, truth[:, CANDIDATE] > 0),
        "kind_accuracy": float((prediction.kinds.argmax(1) == kinds[held].numpy())[failing].mean()),
    }
    return model, card


def _fit_member(
    data: Tensors, own: torch.Tensor, held: torch.Tensor, sizes: tuple[int, int], seed: int
) -> tuple[Member, float]:
    """Fits one member; `sizes` are the numbers of kinds and of egos."""
    torch.manual_seed(seed)
    kinds, egos = sizes
    member = Member(data[0].shape[1] + egos, HEADS + kinds, DROPOUT)
    optimiser = torch.optim.AdamW(member.parameters(), RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, EPOCHS)
    held_beliefs = beliefs(data[3][held], egos)
    best, state, since = float("inf"), member.state_dict(), 0
    for _ in range(EPOCHS):
        member.train()
        for batch in own[torch.randperm(len(own))].split(BATCH):  # type: ignore[no-untyped-call]
            loss = _loss(member, data, batch, beliefs(data[3][batch], egos))
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
        schedule.step()
        member.eval()
        with torch.no_grad():
            value = float(_loss(member, data, held, held_beliefs))
        if value < best:
            best, state, since = value, {name: each.clone() for name, each in member.state_dict().items()}, 0
        else:
            since += 1
            if since >= PATIENCE:
                break
    member.load_state_dict(state)
    return member, best


def beliefs(ego: torch.Tensor, egos: int) -> torch.Tensor:
    """Draws beliefs, `n x egos`, under which these egos are the true ones.

    w ~ Dir(c) and e | w ~ w are drawn the other way round: w | e ~ Dir(c + 1_e).
    """
    concentration = torch.tensor(CONCENTRATIONS)[torch.randint(len(CONCENTRATIONS), (len(ego), 1))]
    counts = concentration + torch.nn.functional.one_hot(ego, egos)
    drawn: torch.Tensor = torch.distributions.Dirichlet(counts.double()).sample().float()
    return drawn


def _loss(member: Member, data: Tensors, rows: torch.Tensor, belief: torch.Tensor) -> torch.Tensor:
    points, heads, kinds = (each[rows] for each in data[:3])
    logits = member(torch.cat([points, belief], 1))
    loss = functional.binary_cross_entropy_with_logits(logits[:, :HEADS], heads)
    failing = heads[:, FAILS] > 0
    if failing.any():
        share = failing.float().mean()
        loss = loss + share * functional.cross_entropy(logits[failing, HEADS:], kinds[failing])
    return loss


def auc(scores: NDArray[np.float32], positive: NDArray[np.bool_]) -> float:
    """Computes the area under the ROC curve."""
    return vargha_delaney(scores[positive].tolist(), scores[~positive].tolist())


def library_of(data: Dataset, model: ScriptModel) -> tuple[NDArray[np.float32], tuple[str, ...]]:
    """Returns library points and their kinds, those that the model expects to fail most egos.

    Candidates for the headline come before other failures, and the second of a kind after the first of all.
    """
    score = model.predict(data.points, model.unknown()).candidate
    rows = np.flatnonzero(data.heads[:, FAILS] > 0)
    rows = rows[np.lexsort((-score[rows], -data.heads[rows, CANDIDATE]))]
    rank: Counter[str] = Counter()
    place = []
    for row in rows:
        kind = str(data.kinds[row])
        place.append((rank[kind], 0 if data.heads[row, CANDIDATE] else 1))
        rank[kind] += 1
    best = rows[np.lexsort(np.array(place).T[::-1])][:LIBRARY]
    return data.points[best], tuple(data.kinds[best].tolist())
