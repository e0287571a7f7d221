"""Plausibility of a failure: how likely road users do what its adversaries did."""

from enum import StrEnum

from risk_sac.records.base import Real, Record


class PlausibilityClass(StrEnum):
    """Class of what the adversaries did, by its probability among road users."""

    ORDINARY = "ordinary"  # 1 in 100 or more
    RARE = "rare"  # 1 in 10,000 or more
    IMPLAUSIBLE = "implausible"


class BehaviourFact(Record):
    """The least likely value of one feature of one adversary."""

    actor: str
    """Its id."""
    feature: str
    """Such as lane_change_gap; see `risk_sac.risk.driving`."""
    value: Real
    """In the feature's unit."""
    time_s: Real
    """From the release."""
    times: int
    """How often the adversary did such a thing."""
    probability: float
    """Share of such events among road users with a value at least as unlikely."""
    published: bool
    """Whether the distribution is published; one of SUMO's drivers makes a failure rare at most."""


class Plausibility(Record):
    """Probability that road users do what the adversaries did."""

    verdict: PlausibilityClass
    """ordinary | rare | implausible: the worse of the two that follow."""
    least_probability: float
    """Least probability of a feature, corrected for the number of features (Holm)."""
    joint_probability: float
    """Probability that all features together are at least as unlikely."""
    facts: tuple[BehaviourFact, ...]
    """All features of all adversaries that acted, the least likely first."""
    sentence: str
    """The least likely feature in words; empty if no adversary acted."""

    @property
    def in_words(self) -> str:
        """Such as "rare: left brakes by 7.0 m/s²: 1 of 970 stops"."""
        return f"{self.verdict}: {self.sentence}" if self.sentence else f"{self.verdict}"

    @property
    def plausible(self) -> bool:
        """Whether it is ordinary or rare."""
        return self.verdict is not PlausibilityClass.IMPLAUSIBLE
