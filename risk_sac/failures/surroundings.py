"""What is told of the neighbours of a failure; see `risk_sac.failures.region`."""

from pydantic import computed_field

from risk_sac.metrics import wilson_interval
from risk_sac.records import Record

NEEDLE = 0.5


class Share(Record):
    """Of the copies that differ from a failure in one way, those that fail as it does."""

    what: str
    """In which way they differ."""
    failed: int
    played: int
    low: float
    """Wilson's 95 % interval of the share."""
    high: float

    @classmethod
    def of(cls, what: str, failed: int, played: int) -> "Share":
        """With its interval."""
        low, high = wilson_interval(failed, played)
        return cls(what=what, failed=failed, played=played, low=low, high=high)


class Region(Record):
    """What surrounds a failure; the shares in the order of `region`."""

    shares: tuple[Share, ...]

    @computed_field  # type: ignore[prop-decorator]
    @property
    def needle(self) -> bool:
        """Whether fewer than half of the nearest scenes fail: a failure that one would hardly meet again."""
        nearest = self.shares[0]
        return nearest.failed < NEEDLE * nearest.played
