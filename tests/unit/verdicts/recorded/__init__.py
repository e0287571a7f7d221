"""Recorded contacts once misjudged, from archive searches of 300 episodes, seed 901."""

import json
from pathlib import Path

import numpy as np

from risk_sac.config import RunSpec
from risk_sac.env.problem import Problem
from risk_sac.verdicts.evidence import Evidence, Ground


def recorded(name: str) -> tuple[Evidence, str]:
    """Returns the evidence of a contact, such as "dense_267", and its striker."""
    family, _ = name.split("_")
    with np.load(Path(__file__).with_name(f"{name}.npz")) as file:
        series = dict(file)
    problem = Problem.from_spec(RunSpec.model_validate({"family": family, "method": "archive", "seed": 901}))
    layout = problem.family.layout(json.loads(str(series["scene"])))
    ground = Ground.of(layout, problem.speed_limit_mps)
    return Evidence.from_series(series, ground, float(series["released_s"])), str(series["striker"])
