"""Fits the script model to script episodes of many scenarios, and selects the libraries."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from risk_sac.config import RunSpec
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.report.statistics import vargha_delaney
from risk_sac.scenario.reading import PAPER_FAMILIES, shipped_names
from risk_sac.search.prior.script_model import CANDIDATE, FAILS, HEADS, MEMBERS, Member, ScriptModel, Tensors
from risk_sac.search.prior.shipped import GRID, ScriptLibrary
from risk_sac.search.prior.tokens import TokenBatch, Tokenizer
from risk_sac.world.types import Floats

LIBRARY = 300  # points of a library, at most
LEAST_FAILURES = 50  # to fit a model to
KINDS, OTHER = 95, "another"  # the most frequent kinds that the model tells apart; the rest is one
HELD_OUT, BATCH, EPOCHS, PATIENCE = 0.1, 256, 40, 6
RATE, DECAY, DROPOUT = 1e-3, 3e-2, 0.15
CONCENTRATIONS = (1e-3, 0.03, 0.3, 3.0)  # of the beliefs in training: from an ego that is known to one that is not
EVERY = 3  # documents by name, of which one is held out


def held_out_documents() -> tuple[str, ...]:
    """Names of the held-out documents: every third by name.

    No model is fitted to them. The paper's families are not among them.
    """
    return tuple(sorted(set(shipped_names()) - set(PAPER_FAMILIES))[EVERY - 1 :: EVERY])


@dataclass(frozen=True, slots=True)
class Dataset:
    """Script episodes as arrays."""

    points: Sequence[Floats]  # n, each as long as its family's points are
    batch: TokenBatch  # of these
    heads: NDArray[np.float32]  # n x HEADS, 0 or 1
    kinds: NDArray[np.str_]  # n; empty where it did not fail
    egos: NDArray[np.str_]
    families: NDArray[np.str_]

    @classmethod
    def read(cls, folder: Path, families: Sequence[str]) -> Self:
        """Reads all files of families."""
        points, batches, heads, kinds, egos, of = list[Floats](), list[TokenBatch](), [], [], [], []
        for family in families:
            tokenizer = Tokenizer(Problem.from_spec(RunSpec(family=family, method="archive", seed=0)))
            for path in sorted(folder.glob(f"{family}-[0-9]*.npz")):
                with np.load(path, allow_pickle=False) as arrays:
                    flags, kind, point = arrays["flags"], arrays["kind"], arrays["point"] / GRID
                    egos.append(arrays["ego"])
                points += list(point)
                batches.append(tokenizer.batch(point))
                heads.append(np.stack([kind != "", flags[:, 0], flags[:, 1]], 1).astype(np.float32))
                kinds.append(kind)
                of.append(np.full(len(point), family))
        joined = [np.concatenate(each) for each in (heads, kinds, egos, of)]
        return cls(points, _padded(batches), *joined)

    def __getitem__(self, rows: NDArray[np.intp]) -> "Dataset":
        """Returns some of its episodes."""
        points = [self.points[row] for row in rows]
        return Dataset(
            points, self.batch.taken(rows), self.heads[rows], self.kinds[rows], self.egos[rows], self.families[rows]
        )

    def of(self, families: Sequence[str]) -> "Dataset":
        """Returns the episodes of some families."""
        return self[np.flatnonzero(np.isin(self.families, families))]


def _padded(batches: Sequence[TokenBatch]) -> TokenBatch:
    """Joins batches with different numbers of actors."""
    most = max(batch.actors.shape[1] for batch in batches)

    def widened(array: NDArray[Any]) -> NDArray[Any]:
        missing = [(0, 0), (0, most - array.shape[1]), *[(0, 0)] * (array.ndim - 2)]
        return np.pad(array, missing)

    by_actor = [[widened(each) for each in (b.actors, b.scripts, b.present, b.turns)] for b in batches]
    actors, scripts, present, turns = (np.concatenate(each) for each in zip(*by_actor, strict=True))
    scene, playable = (np.concatenate(each) for each in zip(*((b.scene, b.playable) for b in batches), strict=True))
    return TokenBatch(scene, actors, scripts, present, turns, playable)


def fit(data: Dataset, seed: int) -> tuple[ScriptModel, dict[str, Any]]:
    """Fits a model; returns it with what it reaches on episodes and documents held out.

    Raises:
      ConfigError: too few episodes failed.
    """
    apart = held_out_documents()
    trained = data[np.flatnonzero(~np.isin(data.families, apart))]
    failed = int(trained.heads[:, FAILS].sum())
    if failed < LEAST_FAILURES:
        got = f"{failed} failures in {len(trained.points)} episodes"
        raise ConfigError("chunks", got, f"{LEAST_FAILURES}", "play more chunks")
    frequent = [kind for kind, _ in Counter(trained.kinds[trained.kinds != ""].tolist()).most_common(KINDS)]
    names, egos = (*frequent, OTHER), tuple(np.unique(trained.egos).tolist())
    order = np.random.default_rng(seed).permutation(len(trained.points))
    size = int(HELD_OUT * len(order))
    held, own = trained[order[:size]], trained[order[size:]]
    members = [_fit_member(own, held, names, egos, seed + i) for i in range(MEMBERS)]
    model = ScriptModel(members, names, egos)
    scores = {"held-out episodes": accuracy(model, held)}
    scores |= {f"held-out episodes of {family}": accuracy(model, held.of([family])) for family in PAPER_FAMILIES}
    scores |= {"held-out documents": accuracy(model, data.of(apart))}
    scores |= {family: accuracy(model, data.of([family])) for family in apart}
    return model, {"episodes": len(trained.points), "failures": failed, "area_under_curve": scores}


def accuracy(model: ScriptModel, data: Dataset) -> dict[str, float]:
    """Returns areas under the ROC curve; none without an episode that failed and one that did not."""
    heads = {"fails": FAILS, "candidate": CANDIDATE}
    truth = {name: data.heads[:, head] > 0 for name, head in heads.items()}
    known = (data.egos[:, None] == np.array(model.egos)[None]).astype(np.float64)
    scores: dict[str, float] = {"episodes": len(data.points), "failures": int(truth["fails"].sum())}
    for belief, word in ((known, "known"), (model.unknown(), "unknown")):
        for name, positive in truth.items():
            if 0 < positive.sum() < len(positive):
                prediction = getattr(model.predict(data.batch, belief), name)
                scores[f"{name}, ego {word}"] = round(auc(prediction, positive), 3)
    return scores


class _Labelled:
    """A dataset as tensors, in both images."""

    def __init__(self, data: Dataset, kinds: Sequence[str], egos: Sequence[str]) -> None:
        place = {kind: i for i, kind in enumerate(kinds)}
        ego = {name: i for i, name in enumerate(egos)}
        self.heads = torch.from_numpy(data.heads)
        self.kinds = torch.tensor([place.get(kind, len(kinds) - 1) for kind in data.kinds.tolist()])
        self.ego = torch.tensor([ego[name] for name in data.egos.tolist()])
        nothing = torch.zeros(len(data.points), len(egos))
        self._sides = [Tensors.of(side, nothing) for side in (data.batch, data.batch.mirrored())]

    def side(self, number: int, rows: torch.Tensor, belief: torch.Tensor) -> Tensors:
        """Returns some points as they are, 0, or mirrored, 1."""
        scene, actors, present, _ = self._sides[number]
        return Tensors(scene[rows], actors[rows], present[rows], belief)


def _fit_member(own: Dataset, held: Dataset, kinds: Sequence[str], egos: Sequence[str], seed: int) -> Member:
    """Fits one member; the epoch counts that is best on `held`."""
    torch.manual_seed(seed)
    member = Member(len(egos), len(kinds), DROPOUT)
    optimiser = torch.optim.AdamW(member.parameters(), RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, EPOCHS)
    learnt, checked = _Labelled(own, kinds, egos), _Labelled(held, kinds, egos)
    rows = torch.arange(len(held.points))
    held_points = checked.side(0, rows, beliefs(checked.ego, len(egos)))
    best, state, since = float("inf"), member.state_dict(), 0
    for _ in range(EPOCHS):
        member.train()
        for batch in torch.randperm(len(own.points)).split(BATCH):  # type: ignore[no-untyped-call]
            side = int(torch.randint(2, ()))
            points = learnt.side(side, batch, beliefs(learnt.ego[batch], len(egos)))
            loss = _loss(member, points, learnt.heads[batch], learnt.kinds[batch])
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
        schedule.step()
        member.eval()
        with torch.no_grad():
            value = float(_loss(member, held_points, checked.heads, checked.kinds))
        if value < best:
            best, state, since = value, {name: each.clone() for name, each in member.state_dict().items()}, 0
        else:
            since += 1
            if since >= PATIENCE:
                break
    member.load_state_dict(state)
    return member


def beliefs(ego: torch.Tensor, egos: int) -> torch.Tensor:
    """Draws beliefs, `n x egos`, under which these egos are the true ones.

    w ~ Dir(c) and e | w ~ w are drawn the other way round: w | e ~ Dir(c + 1_e).
    """
    concentration = torch.tensor(CONCENTRATIONS)[torch.randint(len(CONCENTRATIONS), (len(ego), 1))]
    counts = concentration + torch.nn.functional.one_hot(ego, egos)
    drawn: torch.Tensor = torch.distributions.Dirichlet(counts.double()).sample().float()
    return drawn


def _loss(member: Member, points: Tensors, heads: torch.Tensor, kinds: torch.Tensor) -> torch.Tensor:
    logits = member(points)
    ends = functional.binary_cross_entropy_with_logits(logits[:, :HEADS], heads)
    of_kinds = functional.cross_entropy(logits[:, HEADS:], kinds, reduction="none")
    return ends + (heads[:, FAILS] * of_kinds).mean()


def auc(scores: NDArray[np.float32], positive: NDArray[np.bool_]) -> float:
    """Computes the area under the ROC curve."""
    return vargha_delaney(scores[positive].tolist(), scores[~positive].tolist())


def library_of(data: Dataset, model: ScriptModel, family: str) -> ScriptLibrary:
    """Returns the library of a family: of each kind those points that seem to fail most egos.

    Candidates for the headline come before other failures, and the second of a kind after the first of all.
    """
    prediction = model.predict(data.batch, model.unknown())
    rows = np.flatnonzero(data.heads[:, FAILS] > 0)
    rows = rows[np.lexsort((-prediction.candidate[rows], -data.heads[rows, CANDIDATE]))]
    rank: Counter[str] = Counter()
    place = []
    for row in rows:
        kind = str(data.kinds[row])
        place.append((rank[kind], 0 if data.heads[row, CANDIDATE] else 1))
        rank[kind] += 1
    best = rows[np.lexsort(np.array(place).T[::-1])][:LIBRARY]
    points = np.array([data.points[row] for row in best])
    return ScriptLibrary(family, points, tuple(data.kinds[best].tolist()), prediction.fails[best])
