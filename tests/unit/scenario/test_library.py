"""The library of places that were found on maps."""

import os
from pathlib import Path

import sumo_nets
from risk_sac.scenario import library
from risk_sac.scenario.place import PLACES

NETS = Path(sumo_nets.__path__[0])


def shipped(name: str):
    return PLACES.validate_json((NETS / name / "place.json").read_bytes())


def test_places_that_nobody_names_go_when_they_are_old(tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    named, new, old = (library.keep(shipped(name), b"<net/>") for name in ("low", "mixed", "dense"))
    (tmp_path / "of another program").mkdir()
    for path in (named, old, "of another program"):
        os.utime(tmp_path / path, (0, 0))
    assert library.prune(tmp_path, {named}, 3600.0, 0.0) == [old]
    assert {path.name for path in tmp_path.iterdir()} == {named, new, "of another program"}
    os.utime(tmp_path / new, (0, 0))
    assert library.keep(shipped("mixed"), b"<net/>") == new  # wanted again
    assert library.prune(tmp_path, (), 3600.0, 0.0) == [named]
