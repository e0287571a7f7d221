"""The SUMO bundle, replayed by SUMO's own binary."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sumolib

from risk_sac.failures.export.formats import FormatName
from tests.exports.conftest import CM
from tests.exports.make_examples import FAMILIES


def replayed(folder: Path) -> tuple[int, str]:
    done = subprocess.run([sys.executable, folder / "replay.py"], capture_output=True, text=True)
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stdout


@pytest.mark.parametrize("family", FAMILIES)
def test_the_binary_does_the_same_to_the_last_bit(family, exported):
    status, said = replayed(exported(family, FormatName.SUMO))
    assert re.search(r"\d{2,} steps, \d{3,} states of vehicles: largest difference 0; 0 missing", said), said
    assert status == 0


def test_other_commands_make_a_difference(exported, tmp_path):
    folder = tmp_path / "changed"
    shutil.copytree(exported("low", FormatName.SUMO), folder)
    told = json.loads((folder / "commands.json").read_text())
    faster = next(call for calls in told["commands"][20:] for call in calls if call[1] == "setSpeed")
    faster[2][1] += 0.01
    (folder / "commands.json").write_text(json.dumps(told))
    status, said = replayed(folder)
    assert status == 1
    assert "difference 0;" not in said


@pytest.mark.parametrize("family", FAMILIES)
def test_floating_car_data_are_the_recording(family, exported, failure):
    recorded = failure(family)
    actors = {actor.id: actor for actor in recorded.actors}
    frames = list(sumolib.xml.parse(str(exported(family, FormatName.SUMO) / "fcd.xml"), "timestep"))
    assert len(frames) == recorded.frames
    for frame, step in enumerate(frames):
        for state in [*(step.vehicle or []), *(step.person or [])]:
            actor = actors[state.id]
            front_m = 0.0 if actor.pedestrian else actor.length_m / 2  # SUMO's vehicles are where their front bumper is
            heading = np.radians(90.0 - float(state.angle))
            middle = np.array((float(state.x), float(state.y))) - front_m * np.array((np.cos(heading), np.sin(heading)))
            assert np.hypot(*(middle - (actor.x_m[frame], actor.y_m[frame]))) < CM
    assert {state.id for state in [*(frames[0].vehicle or []), *(frames[0].person or [])]} == set(actors)
