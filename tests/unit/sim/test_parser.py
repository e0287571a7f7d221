"""The parser that is kept between simulations."""

import hashlib
import subprocess
import sys

import pytest

from risk_sac.sim import parser

EPISODES = """
import hashlib
from contextlib import closing
import numpy as np
from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES
from risk_sac.sim import parser, sumo
from risk_sac.sim.sumo import SumoSimulation

if {plain}:
    sumo.keep_parser = lambda: False
seen = hashlib.sha256()
with closing(SumoSimulation(EgoConfig())) as simulation:
    for seed in range(3):
        for family in FAMILIES.values():
            scene = family.space.from_unit(np.random.default_rng(seed).random(family.space.dimension))
            seen.update(simulation.reset(family.layout(scene.values), seed).state.tobytes())
            for _ in range(40):
                seen.update(simulation.step().state.tobytes())
print(parser.keep_parser() if not {plain} else False, seen.hexdigest())
"""


def played(*, plain: bool) -> list[str]:
    """Whether the parser was kept, and the digest of what a process of its own has seen."""
    script = EPISODES.format(plain=plain)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_episodes_are_the_same_with_the_parser_kept() -> None:
    kept, with_it = played(plain=False)
    _, without = played(plain=True)
    assert with_it == without != hashlib.sha256().hexdigest()
    assert kept == str(bool(bundled()))


def bundled() -> list[str]:
    """Where libsumo brings the parser as a library of its own."""
    return [file.name for file in parser.files("libsumo") or () if file.name.startswith(parser.LIBRARY)]


@pytest.mark.parametrize(("name", "value"), [("LIBRARY", "libabsent"), ("INITIALIZE", "_ZN6absent")])
def test_a_library_that_is_built_otherwise_is_let_be(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setattr(parser, name, value)
    assert not parser.keep_parser.__wrapped__()
