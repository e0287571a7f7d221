"""The full time series of a contact as it is told: a record of named arrays, with the unit at the end of each name."""

from pydantic import BaseModel, ConfigDict

Real = float | None  # null where it is not finite: JSON has no other word for that
Reals = list[Real]
RealRows = list[list[Real]]


class Series(BaseModel):
    """Time series of an episode: `T` steps, `n` actors (the ego first), `M` requirements, `a` actions.

    Entries of an actor that is absent are null.
    """

    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)

    time_s: Reals
    """T, of the simulator."""
    released_s: float
    """When the adversaries were handed to the policy, as `time_s` counts."""
    ids: list[str]
    """n."""
    kind: list[str]
    """n; vehicle | pedestrian."""
    role: list[str]
    """n; ego | adversary | background."""
    length_m: Reals
    """n."""
    width_m: Reals
    """n."""
    x_m: RealRows
    """T x n, centre of the body."""
    y_m: RealRows
    """T x n."""
    heading_rad: RealRows
    """T x n; 0 = east, counter-clockwise."""
    speed_mps: RealRows
    """T x n."""
    lateral_mps: RealRows
    """T x n; positive to the left."""
    accel_mps2: RealRows
    """T x n."""
    lane_offset_m: RealRows | None = None
    """T x n; a vehicle's centre from its lane's centre, positive to the left."""
    link: list[list[str | None]] | None = None
    """T x n; SUMO's letter of the signal ahead, such as `g`: green, but has to yield. Null without a signal, and in
    older files."""
    visible: list[list[bool | None]]
    """T x n; to the ego's sensor. Null for the ego itself, here and in what follows."""
    distance_m: RealRows
    """T x n, to the ego."""
    ttc_s: RealRows
    """T x n; null where not on a collision course."""
    rss_longitudinal_m: RealRows
    """T x n, margin; negative where violated."""
    rss_lateral_m: RealRows
    """T x n, margin; negative where violated."""
    requirements: list[str]
    """M."""
    robustness: RealRows
    """T x M, scaled; negative where violated."""
    soft_min: Reals
    """T."""
    actions: RealRows
    """T x a, of the adversaries, normalised: what led to the step."""
    signal: list[str]
    """T; colour ahead of the ego: none | green | yellow | red."""
