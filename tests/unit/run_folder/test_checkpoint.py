import errno
import hashlib
import io
import logging
import os
import pickle

import numpy as np
import pytest
import torch

from risk_sac.errors import CheckpointError
from risk_sac.run_folder import checkpoint

RUN = "a" * 64
CASES = 60


def example_state():
    torch_generator = torch.Generator().manual_seed(3)
    parameters = [torch.nn.Parameter(torch.arange(3.0))]
    optimizer = torch.optim.Adam(parameters, fused=True)
    parameters[0].sum().backward()
    optimizer.step()
    return {
        "episode": 20,
        "dual_variable": 0.1 + 0.2,
        "best": float("inf"),
        "nothing": None,
        "flag": True,
        "name": "ε",
        "blob": b"\x00\xff",
        "pair": (1, 2.5),
        "levels": {3: "c", 1: "a"},
        "records": [{"steps": 3}, {"steps": 4}],
        "weights": torch.linspace(0, 1, 7, dtype=torch.float64),
        "torch_generator": torch_generator.get_state(),
        "optimizer": optimizer.state_dict(),
        "observations": np.arange(12, dtype=np.float32).reshape(3, 4),
        "mask": np.array([True, False]),
        "scalar": np.array(2.5),
        "pcg64": np.random.default_rng(7).bit_generator.state,
        "mt19937": np.random.MT19937(7).state,
        "philox": np.random.Philox(7).state,
    }


def assert_same(found, wanted):
    assert type(found) is type(wanted)
    if isinstance(wanted, dict):
        assert list(found) == list(wanted)
        for key in wanted:
            assert_same(found[key], wanted[key])
    elif isinstance(wanted, list | tuple):
        assert len(found) == len(wanted)
        for one, other in zip(found, wanted, strict=True):
            assert_same(one, other)
    elif isinstance(wanted, torch.Tensor):
        assert found.dtype == wanted.dtype
        assert torch.equal(found, wanted)
    elif isinstance(wanted, np.ndarray):
        assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape)
        np.testing.assert_array_equal(found, wanted)
    else:
        assert found == wanted


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "run.ckpt"
    checkpoint.save(path, example_state(), RUN)
    return path


def test_state_survives_the_round_trip_with_types_and_bits(path):
    assert_same(checkpoint.load(path, RUN), example_state())
    assert [entry.name for entry in path.parent.iterdir()] == ["run.ckpt"]


def test_a_checkpoint_of_an_earlier_version_is_read(tmp_path):
    mask, weights = torch.tensor([True, False]), torch.arange(3.0)
    state = {"mask": {"__ndarray__": mask}, "weights": weights, "pair": (1, 2.5), "levels": {3: "c"}}
    archive = io.BytesIO()
    torch.save({"run_digest": RUN, "state": state}, archive)
    path = tmp_path / "run.ckpt"
    path.write_bytes(archive.getvalue() + hashlib.sha256(archive.getvalue()).digest())
    assert_same(checkpoint.load(path, RUN), state | {"mask": mask.numpy()})


def flipped(content, position):
    damaged = bytearray(content)
    damaged[position // 8] ^= 1 << (position % 8)
    return bytes(damaged)


@pytest.fixture
def two(path):
    """A checkpoint of episode 40 whose predecessor is that of episode 20."""
    checkpoint.save(path, example_state() | {"episode": 40}, RUN)
    return path


def damages(content, cases):
    """Returns `cases` contents with a flipped bit or a lost end."""
    random = np.random.default_rng(1)
    flips = [flipped(content, position) for position in random.integers(len(content) * 8, size=cases // 2)]
    return flips + [content[:length] for length in random.integers(len(content), size=cases - len(flips))]


def test_a_damaged_checkpoint_is_replaced_by_the_one_before_it(two, caplog):
    newest, before = two.read_bytes(), checkpoint.previous(two).read_bytes()
    cases = damages(newest, CASES)
    for case in cases:
        two.write_bytes(case)
        caplog.clear()
        assert checkpoint.load_newest(two, RUN)["episode"] == 20
        (record,) = caplog.records
        assert record.levelno == logging.WARNING
        assert str(two) in record.message
        assert "damaged" in record.message
        assert checkpoint.previous(two).read_bytes() == before
        assert (two.parent / "run.ckpt.damaged").read_bytes() == case
    assert len(cases) == CASES


def test_a_missing_newest_checkpoint_is_replaced_by_the_one_before_it(two):
    two.unlink()  # a crash between the two renames of `save`
    assert checkpoint.load_newest(two, RUN)["episode"] == 20
    assert checkpoint.exists(two)


def test_two_damaged_checkpoints_mean_the_first_episode_and_both_are_named(two, caplog):
    for path in (two, checkpoint.previous(two)):
        path.write_bytes(flipped(path.read_bytes(), 999))
    assert checkpoint.load_newest(two, RUN) is None
    named = zip((two, checkpoint.previous(two)), caplog.records, strict=True)
    assert all(str(path) in record.message for path, record in named)
    assert not checkpoint.exists(two)


def test_a_damaged_checkpoint_never_takes_the_place_of_the_good_one_before_it(two):
    two.write_bytes(b"damaged")
    checkpoint.load_newest(two, RUN)
    checkpoint.save(two, {"episode": 60}, RUN)
    two.write_bytes(b"damaged again")
    assert checkpoint.load_newest(two, RUN)["episode"] == 20


def test_a_checkpoint_of_another_run_is_no_reason_to_begin_anew(two):
    with pytest.raises(CheckpointError, match="belongs to the run"):
        checkpoint.load_newest(two, "b" * 64)


class Bomb:
    def __reduce__(self):
        return os.mkdir, ("bomb",)


@pytest.mark.parametrize("content", [Bomb(), [1, 2], {"state": {}}], ids=["code", "list", "no digest"])
def test_well_signed_file_with_foreign_content_is_refused_and_never_run(tmp_path, monkeypatch, content):
    monkeypatch.chdir(tmp_path)
    archive = io.BytesIO()
    torch.save(content, archive, pickle_module=pickle)
    payload = archive.getvalue()
    path = tmp_path / "x"
    path.write_bytes(payload + hashlib.sha256(payload).digest())
    with pytest.raises(CheckpointError, match="something else"):
        checkpoint.load(path, RUN)
    assert not (tmp_path / "bomb").exists()


@pytest.mark.parametrize("function", ["fsync", "replace"])
def test_full_disk_leaves_both_checkpoints_and_no_litter(two, monkeypatch, function):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, function, full)
    with pytest.raises(OSError, match="No space left"):
        checkpoint.save(two, {"episode": 60}, RUN)
    monkeypatch.undo()
    assert sorted(entry.name for entry in two.parent.iterdir()) == ["run.ckpt", "run.ckpt.previous"]
    assert checkpoint.load(two, RUN)["episode"] == 40
    assert checkpoint.load(checkpoint.previous(two), RUN)["episode"] == 20


def test_a_disk_that_refuses_the_second_rename_leaves_the_newest_checkpoint(two, monkeypatch):
    renames = []

    def once(*paths, replace=os.replace):
        renames.append(paths)
        if len(renames) == 2:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        replace(*paths)

    monkeypatch.setattr(os, "replace", once)
    with pytest.raises(OSError, match="Input/output error"):
        checkpoint.save(two, {"episode": 60}, RUN)
    assert checkpoint.load_newest(two, RUN)["episode"] == 40
