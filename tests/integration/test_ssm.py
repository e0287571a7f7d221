"""Our TTC against SUMO's own surrogate-safety device, which measures along the lane and knows no boxes.

libsumo holds one simulation per process and these scenes need options that the environment never sets, so each
scene runs in a process of its own.
"""

import json
import subprocess
import sys
import textwrap
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from risk_sac.geometry import relative_view
from risk_sac.risk.ttc import TTC_CAP_S, time_to_collision
from risk_sac.types import Frame
from tests import builders

LENGTH_M, WIDTH_M = 4.6, 1.85
SCENE = textwrap.dedent(
    """
    import json, sys
    from importlib.resources import files
    import libsumo

    folder, gap_m, ego_mps, lead_mps, brake_mps2 = sys.argv[1], *map(float, sys.argv[2:])
    nets = files("sumo_nets")
    libsumo.start(
        ["sumo", "-n", str(nets / "low" / "low.net.xml"), "-a", str(nets / "vtypes.add.xml"), "--step-length", "0.1",
         "--no-step-log", "--no-warnings", "--insertion-checks", "none", "--default.speeddev", "0",
         "--step-method.ballistic", "--collision.action", "warn",
         "--device.ssm.explicit", "ego", "--device.ssm.measures", "TTC", "--device.ssm.thresholds", "1000",
         "--device.ssm.trajectories", "true", "--device.ssm.range", "200", "--device.ssm.file", folder + "/ssm.xml"]
    )
    libsumo.route.add("r", ["road"])
    for id_, position, speed in (("ego", 200.0, ego_mps), ("lead", 200.0 + gap_m + 4.6, lead_mps)):
        libsumo.vehicle.add(id_, "r", typeID="ego_Krauss",
                            departLane="1", departPos=str(position), departSpeed=str(speed))
    libsumo.simulationStep()
    libsumo.vehicle.setLaneChangeMode("ego", 0)
    libsumo.vehicle.setSpeedMode("lead", 0)
    rows, speed = [], lead_mps
    for step in range(80):
        rows.append(
            (libsumo.simulation.getTime() - 0.1,  # the device stamps a step with its beginning
             [(*libsumo.vehicle.getPosition(v), libsumo.vehicle.getAngle(v), libsumo.vehicle.getSpeed(v))
              for v in ("ego", "lead")])
        )
        if step >= 10:
            speed = max(speed - brake_mps2 * 0.1, 0.0)
        libsumo.vehicle.setSpeed("lead", speed)
        libsumo.simulationStep()
    libsumo.close()
    print(json.dumps(rows))
    """
)


def frame_of(time_s: float, bumpers: list[list[float]]) -> Frame:
    """SUMO's front bumpers and compass angles as a frame."""
    x, y, angle, speed = np.array(bumpers).T
    heading = np.radians(90.0 - angle)
    return builders.frame_of(
        time_s=time_s,
        ids=("ego", "lead"),
        x_m=x - LENGTH_M / 2 * np.cos(heading),
        y_m=y - LENGTH_M / 2 * np.sin(heading),
        heading_rad=heading,
        speed_mps=speed,
        length_m=LENGTH_M,
        width_m=WIDTH_M,
    )


def by_sumo(path: Path) -> dict[float, float]:
    """Time -> TTC of the ego's encounters with the leader, where SUMO has one."""
    values: dict[float, float] = {}
    for conflict in ElementTree.parse(path).getroot().iter("conflict"):
        times = conflict.find("timeSpan").get("values").split()  # type: ignore[union-attr]
        ttcs = conflict.find("TTCSpan").get("values").split()  # type: ignore[union-attr]
        values |= {round(float(t), 3): float(v) for t, v in zip(times, ttcs, strict=True) if v != "NA"}
    return values


@pytest.mark.parametrize(
    ("gap_m", "ego_mps", "lead_mps", "brake_mps2"),
    [(40.0, 16.0, 8.0, 0.0), (25.0, 14.0, 14.0, 6.0), (12.0, 12.0, 12.0, 3.0)],
    ids=["closing in", "hard braking", "close and braking"],
)
def test_ttc_in_car_following_is_that_of_sumos_own_safety_device(
    tmp_path: Path, gap_m: float, ego_mps: float, lead_mps: float, brake_mps2: float
) -> None:
    arguments = [str(tmp_path), *(str(v) for v in (gap_m, ego_mps, lead_mps, brake_mps2))]
    done = subprocess.run([sys.executable, "-c", SCENE, *arguments], capture_output=True, text=True, check=True)
    rows = json.loads(done.stdout.splitlines()[-1])
    theirs = by_sumo(tmp_path / "ssm.xml")
    ours = {round(t, 3): time_to_collision(relative_view(frame_of(t, bumpers)))[0] for t, bumpers in rows}
    compared = [(ours[t], ttc) for t, ttc in theirs.items() if t in ours]
    assert len(compared) >= 15
    mine, expected = np.array(compared).T
    np.testing.assert_allclose(mine, np.minimum(expected, TTC_CAP_S), atol=0.011)  # it writes two decimals
    assert mine.min() < 6.0
