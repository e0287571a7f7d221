"""Time to collision under constant velocity, in the plane."""

import numpy as np

from risk_sac.geometry import RelativeView, time_to_contact
from risk_sac.jit import compiled
from risk_sac.types import Floats

TTC_CAP_S = 10.0  # longer times carry no risk and would only stretch the scale


@compiled
def time_to_collision(view: RelativeView) -> Floats:
    """TTC of the ego with each other actor, `n`, s, capped at `TTC_CAP_S`.

    Bodies are swept as oriented boxes, so crossing and oncoming conflicts count as much as following;
    for a leader in the same lane it equals gap / closing speed (Hayward 1972).
    """
    return np.minimum(time_to_contact(view), TTC_CAP_S)
