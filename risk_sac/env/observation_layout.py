"""Sizes and scales of an observation; see `risk_sac.env.observation`."""

MOTION_PER_ADVERSARY = 10
PER_ADVERSARY = MOTION_PER_ADVERSARY + 6  # the memory of C_soft: `risk_sac.risk.conduct.ADVERSARY_MEMORY`
PER_EGO = 8
PER_STATIC = 2  # where it is in the ego's frame
LATERAL_ADVERSARY, LATERAL_EGO = (1, 3, 5), 2  # the entries of these that change their sign in a mirror
LIMIT = 5.0  # of every entry

X_M, Y_M, SPEED_MPS, LATERAL_MPS, ACCEL_MPS2, GAP_M = 40.0, 8.0, 15.0, 4.0, 8.0, 20.0  # scales


def observation_size(adversaries: int, scene_size: int, requirements: int, statics: int = 0) -> int:
    """Entries of an observation."""
    return PER_ADVERSARY * adversaries + PER_EGO + scene_size + requirements + PER_STATIC * statics + 1
