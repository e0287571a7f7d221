"""Two frames around a contact at a given place, for tests."""

import math

import numpy as np

from risk_sac.sim.collision import Contact, find_contact
from risk_sac.world.types import STEP_S, Frame, Kind
from tests.builders import frame_of

LENGTH_M, WIDTH_M = 4.6, 1.85
CAR, WALKER = Kind.VEHICLE, Kind.PEDESTRIAN
Actor = tuple[float, float, float, float, float, Kind]  # x, y, heading, vx, vy at the end of the step, kind


def frames(
    *actors: Actor, step_s: float = STEP_S, time_s: float = 5.0, share: float = 0.5, ids: tuple[str, ...] | None = None
) -> tuple[Frame, Frame]:
    """Two frames around a given instant; `share` of the step precedes it.

    The first actor is the ego; everybody keeps velocity and heading.
    """
    columns = np.array([actor[:5] for actor in actors], dtype=np.float64).T
    kinds = [actor[5] for actor in actors]

    def at(offset_s: float) -> Frame:
        return frame_of(
            kinds,
            time_s=time_s + offset_s,
            ids=ids,
            x_m=columns[0] + columns[3] * offset_s,
            y_m=columns[1] + columns[4] * offset_s,
            heading_rad=columns[2],
            vx_mps=columns[3],
            vy_mps=columns[4],
        )

    return at(-share * step_s), at((1 - share) * step_s)


def contact_of(before: Frame | None, frame: Frame) -> Contact | None:
    return find_contact(before, frame)


def ego(speed_mps: float = 10.0, lateral_mps: float = 0.0) -> Actor:
    return (0.0, 0.0, 0.0, speed_mps, lateral_mps, CAR)


# At the given instant the bodies touch with no overlap, so that places can be read off the numbers.
INTO_LEADER = (ego(15.0), (LENGTH_M, 0.0, 0.0, 5.0, 0.0, CAR))
FROM_BEHIND = (ego(5.0), (-LENGTH_M, 0.0, 0.0, 15.0, 0.0, CAR))
SIDESWIPE = (ego(10.0), (-0.5, WIDTH_M, 0.0, 10.0, -1.5, CAR))  # contact from 2.8 m behind the front bumper
CUT_IN = (ego(10.0), (LENGTH_M - 0.5, WIDTH_M, 0.0, 9.0, -1.5, CAR))  # its rear right corner, 0.5 m from the bumper
EGO_DRIFTS = (ego(10.0, 1.5), (-0.5, WIDTH_M, 0.0, 10.0, 0.0, CAR))
# From the right, its front into the ego's flank 2.3 m behind the bumper.
CROSSING = (ego(8.0), (0.0, -(WIDTH_M + LENGTH_M) / 2, math.pi / 2, 0.0, 12.0, CAR))
INTO_CROSSING = (ego(12.0), ((LENGTH_M + WIDTH_M) / 2, 0.0, math.pi / 2, 0.0, 8.0, CAR))
HEAD_ON = (ego(10.0), (LENGTH_M, 0.3, math.pi, -10.0, 0.0, CAR))
INTO_WALKER = (ego(10.0), (LENGTH_M / 2 + 0.25, 0.2, math.pi / 2, 0.0, 1.5, WALKER))
WALKER_INTO_FLANK = (ego(10.0), (-1.0, -WIDTH_M / 2 - 0.25, math.pi / 2, 0.0, 1.5, WALKER))
