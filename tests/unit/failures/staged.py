"""A contact made by hand, with its time series."""

import numpy as np
from numpy.typing import NDArray

from risk_sac.records import ConflictType, Judgement, Outcome
from risk_sac.run_folder.results import RecordedFailure
from risk_sac.scenario.bodies import CODES
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.space import SceneSpace
from tests.builders import AVOIDS, TOUCHES, collision, episode_record, judgement

JUDGED = judgement(
    conflict_type=ConflictType.PEDESTRIAN,
    conflict_s=0.75,
    conflict_x_m=302.0,
    conflict_y_m=-3.25,
    broke=("pedestrian_on_red",),
    drivers={"r157": AVOIDS, "rss": TOUCHES, "full_braking": AVOIDS},
)


def synthetic_contact(judged: Judgement = JUDGED) -> RecordedFailure:
    """Contact of an ego at 10 m/s eastward with a northward pedestrian."""
    space: SceneSpace = FAMILIES["mixed"].space
    hit = collision(
        time_s=1.95,
        other_id="pedestrian",
        other_kind="pedestrian",
        other_body="pedestrian",
        contact_y_m=-0.5,
        other_zone="left",
        ego_speed_mps=10.0,
        other_speed_mps=1.0,
        relative_speed_mps=10.05,
        lateral_offset_m=-0.5,
        early_min_ttc_s=0.1,
        visible_for_s=1.0,
        ego_peak_braking_mps2=0.0,
        verdicts={"ego_moving": True},
        judgement=judged,
    )
    episode = episode_record(
        7,
        Outcome.FAILURE,
        seed=1,
        scene=space.from_unit(np.full(space.dimension, 0.4)).values,
        steps=20,
        environment_steps=20,
        min_ttc_s=0.1,
        collision=hit,
    )
    return RecordedFailure.of("low-random-0", episode)


def synthetic_series() -> dict[str, NDArray[np.generic]]:
    """Series of ego, pedestrian, and a bystander that leaves after one second."""
    t = np.arange(21) * 0.1
    zero, gone = np.zeros_like(t), np.where(t < 1.0, 0.0, np.nan)
    return {
        "time_s": t + 0.1,
        "released_s": np.array(0.1),
        "ids": np.array(["ego", "pedestrian", "bystander"]),
        "kind": np.array([0, 1, 0], dtype=np.int8),
        "body": np.array([CODES["car"], CODES["pedestrian"], CODES["car"]], dtype=np.int8),
        "role": np.array([0, 1, 2], dtype=np.int8),
        "length_m": np.array([4.6, 0.5, 4.6]),
        "width_m": np.array([1.85, 0.5, 1.85]),
        "requirements": np.array(["safe_ttc", "pedestrian_gap"]),
        "robustness": np.column_stack((1 - t, 2 - t)),
        "soft_min": 1 - t,
        "signal": np.zeros(21, dtype=np.int8),
        "x_m": np.column_stack((280 + 10 * t, zero + 302, gone + 260)),
        "y_m": np.column_stack((zero - 1.65, -4 + t, gone + 1.65)),
        "heading_rad": np.column_stack((zero, zero + np.pi / 2, gone + np.pi)),
        "speed_mps": np.column_stack((zero + 10, zero + 1, gone + 5)),
        "lateral_mps": np.column_stack((zero, zero, gone)),
        "accel_mps2": np.column_stack((zero, zero, gone)),
        "distance_m": np.column_stack((zero + np.nan, 20 - 10 * t, gone + 20)),
        "ttc_s": np.column_stack((zero + np.nan, 2 - t, gone + 10)),
        "rss_longitudinal_m": np.column_stack((zero + np.nan, zero, gone)),
        "rss_lateral_m": np.column_stack((zero + np.nan, zero, gone)),
        "visible": np.column_stack((zero + np.nan, t > 1.0, gone + 1)),
        "actions": np.zeros((21, 2)),
    }


def with_release() -> dict[str, NDArray[np.generic]]:
    """Prepends 1.5 s before the release, in which only the ego drives."""
    series, early = synthetic_series(), 15
    count = len(series["time_s"])
    rows = {name: values for name, values in series.items() if values.ndim and len(values) == count}
    longer = {name: np.concatenate((np.repeat(values[:1], early, axis=0), values)) for name, values in rows.items()}
    t = np.arange(early + count) * 0.1 - 1.5
    x_m = longer["x_m"].copy()
    x_m[:, 0] = 280 + 10 * t
    return series | longer | {"time_s": t + 1.6, "x_m": x_m, "released_s": np.array(1.6)}
