"""The pretrained policy: files, and networks folded into a problem's own layout."""

from dataclasses import replace

import numpy as np
import pytest

from risk_sac.config import RunSpec
from risk_sac.env.observation_layout import MOTION_PER_ADVERSARY, PER_ADVERSARY, PER_EGO
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.search.frozen_policy import respond
from risk_sac.search.prior.policy import Folded, PolicyLayout, read_policy, write_policy
from risk_sac.world.types import Vector
from tests.builders import pretrained_policy


@pytest.fixture
def layout():
    return PolicyLayout.of(Problem.from_spec(RunSpec(family="low", method="risk-sac", seed=0)))


@pytest.fixture
def pretrained(layout):
    return pretrained_policy(layout)


def plain(layers: tuple[np.ndarray, ...], member: int = 0) -> list[np.ndarray]:
    """Layers of one network as `respond` takes them."""
    return [layer[member] if layer.shape[1] > 1 else layer[member, 0] for layer in layers]


def observed(layout: PolicyLayout) -> Vector:
    return np.random.default_rng(4).random(layout.observation_size).astype(np.float32)


def test_a_file_gives_back_what_was_written(tmp_path, pretrained):
    path = tmp_path / "low-policy.npz"
    write_policy(path, pretrained)
    known = read_policy(path)
    assert (known.family, known.layout) == ("low", pretrained.layout)
    assert known.card == {"episodes": 12}
    for own, other in zip((*known.policy, *known.critics), (*pretrained.policy, *pretrained.critics), strict=True):
        np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize("damage", ["cut", "text", "layout", "nan", "temperature"])
def test_other_files_are_refused_in_one_line(tmp_path, pretrained, damage):
    path = tmp_path / "low-policy.npz"
    if damage == "layout":
        pretrained = replace(pretrained, layout=replace(pretrained.layout, requirements=("no_contact",)))
    if damage == "temperature":
        pretrained = replace(pretrained, temperature=0.0)
    if damage == "nan":
        pretrained.critics[0][:] = np.nan
    write_policy(path, pretrained)
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-100])
    if damage == "text":
        path.write_text("no arrays")
    with pytest.raises(ConfigError, match=r"^prior: .*low-policy.npz") as raised:
        read_policy(path)
    assert "\n" not in str(raised.value)


def test_a_policy_that_knows_motion_alone_does_the_same_whatever_else_is_observed(layout):
    known = replace(layout, per_adversary=MOTION_PER_ADVERSARY)
    pretrained = pretrained_policy(known)
    seen, rest = observed(layout), PER_ADVERSARY * len(layout.adversaries)
    rows = seen[:rest].reshape(-1, PER_ADVERSARY)
    motion = np.concatenate((rows[:, :MOTION_PER_ADVERSARY].ravel(), seen[rest:]))
    got = respond(plain(Folded.of(pretrained, layout).policy), seen)
    np.testing.assert_allclose(got, respond(plain(pretrained.policy), motion), atol=1e-4)


def test_networks_folded_into_their_own_layout_do_the_same(pretrained, layout):
    folded, seen = Folded.of(pretrained, layout), observed(layout)
    np.testing.assert_allclose(respond(plain(folded.policy), seen), respond(plain(pretrained.policy), seen), atol=1e-4)
    action = np.linspace(-1, 1, layout.action_size, dtype=np.float32)
    for member in range(2):
        value = respond(plain(folded.critics, member), np.concatenate((seen, action)))
        wanted = respond(plain(pretrained.critics, member), np.concatenate((seen, action)))
        np.testing.assert_allclose(value, wanted, atol=1e-4)


def test_another_layout_is_read_by_names_and_values(pretrained, layout):
    """The other problem reorders and adds adversaries, widens bounds, lacks a requirement."""
    (name, low, high), *others = layout.scene
    own = PolicyLayout(
        adversaries=("stranger", *reversed(layout.adversaries)),
        scene=((name, low - 1.0, high + 1.0), *others),
        requirements=layout.requirements[1:],
    )
    seen = observed(own)
    adversaries = {a: seen[PER_ADVERSARY * i : PER_ADVERSARY * (i + 1)] for i, a in enumerate(own.adversaries)}
    rest = seen[PER_ADVERSARY * len(own.adversaries) :]
    value = low - 1.0 + rest[PER_EGO] * (high - low + 2.0)
    known = np.concatenate(
        [
            *(adversaries[each] for each in layout.adversaries),
            rest[:PER_EGO],
            [(value - low) / (high - low)],
            rest[PER_EGO + 1 : PER_EGO + len(own.scene)],
            [1.0],
            rest[PER_EGO + len(own.scene) :],
        ]
    ).astype(np.float32)

    mean, log_std = np.split(respond(plain(Folded.of(pretrained, own).policy), seen), 2)
    wanted = np.split(respond(plain(pretrained.policy), known), 2)
    for got, expected in zip((mean, log_std), wanted, strict=True):
        assert not got[:2].any()  # the stranger does as it likes
        by_name = {a: expected[2 * i : 2 * i + 2] for i, a in enumerate(layout.adversaries)}
        np.testing.assert_allclose(got[2:], np.concatenate([by_name[a] for a in own.adversaries[1:]]), atol=1e-4)
