"""The shipped documents pose the scenes that their patterns posed before."""

import hashlib

import numpy as np
import pytest

from risk_sac.scenario.families import FAMILIES

# Of the layouts of 200 scenes each, recorded when three patterns in code still made them.
LAYOUTS = {"low": "afc2a66353e96757", "mixed": "1df45afce8cf9250", "dense": "023eea3053c3a5e8"}


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_stay_equal(name: str) -> None:
    family, random = FAMILIES[name], np.random.default_rng(1)
    digest = hashlib.sha256()
    for _ in range(200):
        scene = family.space.from_unit(random.random(family.space.dimension))
        digest.update(repr(family.layout(scene.values)).encode())
    assert digest.hexdigest().startswith(LAYOUTS[name])
