"""What a minimised failure is told with; see `risk_sac.failures.minimise`."""

from risk_sac.records import Record


class Extent(Record):
    """How much the adversaries do."""

    adversaries: int
    """That do anything but drive on as SUMO's drivers would, or walk on."""
    segments: int
    """Segments of 0.5 s of an adversary in which it does."""
    channels: int
    """Of these, drive and steering counted apart."""
    strongest: float
    """Greatest action, of 1."""


class Core(Record):
    """What was left of a failure, and how surely it fails."""

    before: Extent
    after: Extent
    plain_parameters: int
    """Of the scene, in the middle of their ranges."""
    parameters: int
    """Without those that stand for one of two categories."""
    episodes: int
    """That were played to find it."""
    held: int
    """Copies, perturbed by up to 1 %, that still fail; other ones than those that the reductions were chosen by."""
    copies: int
    sentence: str
    """What happens, in words."""
