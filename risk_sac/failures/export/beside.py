"""The JSON beside an export: what its format cannot carry, and where all of it comes from."""

import json
from typing import Any

import numpy as np

from risk_sac.failures.export.recorded import Recorded

BESIDE = "beside.json"  # its name, which the files that it lies beside have in them
PER_OTHER = ("visible", "distance_m", "ttc_s", "rss_longitudinal_m", "rss_lateral_m")


def beside(failure: Recorded, lacks: tuple[str, ...]) -> bytes:
    """The file.

    Args:
      failure: that is exported.
      lacks: what the format cannot carry, in words.
    """
    manifest, series = failure.manifest, failure.series
    ids = [actor.id for actor in failure.actors]
    told = {
        "failure": failure.name,
        "not_in_the_format": lacks,
        "first_frame_s": 0.0,
        "released_s": failure.released_s,
        "run": manifest.spec.model_dump(mode="json"),
        "odd": failure.problem.odd.model_dump(mode="json"),
        "requirements": [requirement.model_dump(mode="json") for requirement in failure.problem.requirements],
        "episode": manifest.episode.model_dump(mode="json"),
        "friction": failure.layout.friction,
        "roles": {actor.id: actor.role.name.lower() for actor in failure.actors},
        "time_s": failure.time_s,
        "robustness": {str(name): series["robustness"][:, i] for i, name in enumerate(series["requirements"])},
        "soft_min": series["soft_min"],
        "to_the_ego": {
            name: {id_: series[name][:, column] for column, id_ in enumerate(ids) if column} for name in PER_OTHER
        },
        "signals": {id_: [bytes(row).decode() for row in rows] for id_, rows in failure.heads.items()},
        "trajectory_digest": manifest.digest,
        "versions": dict(manifest.versions),
        "code": manifest.code,
        "world": dict(manifest.world),
    }
    return json.dumps(_plain(told), allow_nan=False).encode()


def _plain(value: Any) -> Any:
    """As JSON has it; a number that is not finite is null, which the README of this room explains."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return [round(float(item), 6) if np.isfinite(item) else None for item in value]
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
