from pathlib import Path

import pytest

from risk_sac.pretraining import episodes
from risk_sac.pretraining.episodes import Stream


def test_an_interrupted_stream_goes_on_as_if_it_had_not_been(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(episodes, "CHUNK", 12)
    monkeypatch.setattr(episodes, "TURN", 6)
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for folder in (whole, parts):
        folder.mkdir()
    Stream("low", 5, 0).play(whole, 3)
    Stream("low", 5, 0).play(parts, 2)
    Stream("low", 5, 0).play(parts, 3)
    names = sorted(path.name for path in whole.iterdir())
    assert names == [f"low-00-000{k}.npz" for k in range(3)]
    for name in names:
        assert (whole / name).read_bytes() == (parts / name).read_bytes()
