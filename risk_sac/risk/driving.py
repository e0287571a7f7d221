"""Lists what drivers and pedestrians do in daily traffic, and how often.

One row per feature: what it measures, of which event, and its distribution among road users. A row without a published
distribution is measured on SUMO's own drivers in undisturbed scenes, see `risk_sac.verdicts.plausibility`.

Choice: where a source gives two quantiles, or a mean and the extremes of a sample, the distribution of the stated shape
through them is used. No sample here has more than some thousand events, so nothing is called rarer than `LEAST`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

LEAST = 1e-6  # choice: the least tail probability that is ever stated


class HasTails(Protocol):
    """A distribution of one number."""

    def below(self, value: float) -> float:
        """Probability of a value of at most this."""
        ...

    def above(self, value: float) -> float:
        """Probability of a value of at least this."""
        ...


@dataclass(frozen=True, slots=True)
class NormalSpread:
    """A normal distribution."""

    mean: float
    deviation: float

    def below(self, value: float) -> float:
        """Probability of a value of at most this."""
        return math.erfc((self.mean - value) / (self.deviation * math.sqrt(2.0))) / 2.0

    def above(self, value: float) -> float:
        """Probability of a value of at least this."""
        return math.erfc((value - self.mean) / (self.deviation * math.sqrt(2.0))) / 2.0


@dataclass(frozen=True, slots=True)
class LognormalSpread:
    """A lognormal distribution, by its median and the deviation of the logarithm."""

    median: float
    deviation: float

    def below(self, value: float) -> float:
        """Probability of a value of at most this; 0 up to 0."""
        if value <= 0.0:
            return 0.0
        return NormalSpread(math.log(self.median), self.deviation).below(math.log(value))

    def above(self, value: float) -> float:
        """Probability of a value of at least this."""
        if value <= 0.0:
            return 1.0
        return NormalSpread(math.log(self.median), self.deviation).above(math.log(value))


@dataclass(frozen=True, slots=True)
class LogisticSpread:
    """A logistic distribution: what a binary logit of one variable says."""

    median: float
    scale: float

    def below(self, value: float) -> float:
        """Probability of a value of at most this."""
        return 1.0 / (1.0 + math.exp((self.median - value) / self.scale))

    def above(self, value: float) -> float:
        """Probability of a value of at least this."""
        return 1.0 / (1.0 + math.exp((value - self.median) / self.scale))


@dataclass(frozen=True, slots=True)
class UpperTail:
    """Upper tail by points, log-linear between them and beyond the last."""

    values: tuple[float, ...]  # ascending
    probabilities: tuple[float, ...]  # descending, of at least that value

    def below(self, value: float) -> float:
        """Probability of a value of less than this."""
        return 1.0 - self.above(value)

    def above(self, value: float) -> float:
        """Probability of at least this value; constant before the first point."""
        if value <= self.values[0] or len(self.values) == 1:
            return self.probabilities[0]
        k = 1
        while k < len(self.values) - 1 and self.values[k] < value:
            k += 1
        (left, right), (more, less) = self.values[k - 1 : k + 1], self.probabilities[k - 1 : k + 1]
        share = (value - left) / (right - left)
        return math.exp((1.0 - share) * math.log(more) + share * math.log(less))


@dataclass(frozen=True, slots=True)
class LowerTail:
    """A lower tail by points: the upper tail of the negative value."""

    mirrored: UpperTail

    def below(self, value: float) -> float:
        """Probability of a value of at most this."""
        return self.mirrored.above(-value)

    def above(self, value: float) -> float:
        """Probability of a value of more than this."""
        return self.mirrored.below(-value)


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadUserFeature:
    """One feature of what a road user did."""

    name: str
    unit: str
    per: str  # what its probability is a share of
    unlikely: Literal["above", "below"]  # the side of the unlikely values
    words: str  # the sentence, with {value}
    source: str
    spread: HasTails | None = None  # None: measured on SUMO's drivers
    event: str = ""  # features of one event, such as a lane change, are no independent evidence; "": its own

    @property
    def published(self) -> bool:
        """Whether its distribution is a published one."""
        return self.spread is not None and self.source != CHOICE


SUMO = "SUMO's drivers, measured"
CHOICE = "choice: no distribution is published, and SUMO's pedestrians stand in undisturbed scenes"

_ROWS = (
    RoadUserFeature(
        name="braking",
        unit="m/s²",
        per="stops",
        unlikely="above",
        words="brakes by {value:.1f} m/s²",
        # Lognormal of mean 3.27 m/s² whose 1 of 822 quantiles are near the extremes, 1.51 and 7.47 m/s². It is the mean
        # deceleration of a stop there, the mean of 0.5 s here.
        source="Evaluation of Driver Deceleration Behavior at Signalized Intersections 2007, TRID 01049374: 821 stops",
        spread=LognormalSpread(3.16, 0.264),
    ),
    RoadUserFeature(
        name="acceleration",
        unit="m/s²",
        per="starts",
        unlikely="above",
        words="accelerates by {value:.1f} m/s²",
        # Drivers use N(0.60, 0.08) of what their car can do. Choice: 4.6 m/s², a car of 9 s to 100 km/h.
        source="Snare 2002, Typical Acceleration Rates of Passenger Vehicles; a car that can do 4.6 m/s²: choice",
        spread=NormalSpread(2.76, 0.37),
    ),
    RoadUserFeature(
        name="jerk",
        unit="m/s³",
        per="drives",
        unlikely="above",
        words="jerks by {value:.0f} m/s³",
        source=SUMO,
    ),
    RoadUserFeature(
        name="pedal_changes",
        unit="1 in 5 s",
        per="drives",
        unlikely="above",
        words="changes between gas and brake {value:.0f} times in 5 s",
        # None of 9,905 stretches of 20 s has more than two changes between accelerations above 0.5 m/s², at 1 Hz, and
        # 73 have two. SUMO's drivers change more often, and up to five the larger share, theirs, counts. Choice: six
        # are as rare as one of those stretches, and nothing is much rarer.
        source="NREL Transportation Secure Data Center, Chicago Metropolitan Agency for Planning 2007: 58 h, 22 cars",
        spread=UpperTail((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0), (1.0, 0.46, 0.21, 0.15, 1e-3, 5e-4, 1e-4, 7e-5)),
    ),
    RoadUserFeature(
        name="lane_change_duration",
        event="lane change",
        unit="s",
        per="lane changes",
        unlikely="below",
        words="changes lane in {value:.1f} s",
        # Lognormal; its 1 of 5,609 quantiles are the extremes, 0.7 and 12.4 s.
        source="Wang, Yang and Hurwitz 2019, doi 10.1016/j.aap.2019.01.006: 5,608 cut-ins",
        spread=LognormalSpread(2.95, 0.40),
    ),
    RoadUserFeature(
        name="lane_change_gap",
        event="lane change",
        unit="m",
        per="lane changes",
        unlikely="below",
        words="changes lane {value:.1f} m before the next vehicle",
        # Median 7.58 m before an automated vehicle, 68.0 % below 10 m. Lognormal: choice.
        source="Alhuraish, Wang and Zhou 2026, arXiv 2605.01485: 706 cut-ins before automated vehicles",
        spread=LognormalSpread(7.58, 0.59),
    ),
    RoadUserFeature(
        name="lane_change_headway",
        event="lane change",
        unit="s",
        per="lane changes",
        unlikely="below",
        words="changes lane {value:.1f} s before the next vehicle",
        # Lognormal; 12 % below 0.5 s, 20 % above 1.7 s.
        source="Bham, Estimating Driver Mandatory Lane Change Behavior on a Multi-Lane Freeway: I-80, congested",
        spread=LognormalSpread(1.02, 0.61),
    ),
    RoadUserFeature(
        name="lane_change_ttc",
        event="lane change",
        unit="s",
        per="lane changes",
        unlikely="below",
        words="changes lane {value:.1f} s before the next vehicle would touch it",
        source=SUMO,
    ),
    RoadUserFeature(
        name="lateral_speed",
        event="lane change",
        unit="m/s",
        per="lane changes",
        unlikely="above",
        words="moves across by {value:.1f} m/s",
        # A lane of 3.5 m in the durations above.
        source="Wang, Yang and Hurwitz 2019, doi 10.1016/j.aap.2019.01.006: from the durations",
        spread=LognormalSpread(1.19, 0.40),
    ),
    RoadUserFeature(
        name="over_line",
        unit="s",
        per="drives",
        unlikely="above",
        words="keeps to a line or over it for {value:.1f} s without changing lane",
        source=SUMO,
    ),
    RoadUserFeature(
        name="pacing",
        unit="s",
        per="drives",
        unlikely="above",
        words="stays level with a vehicle at its speed for {value:.1f} s",
        source=SUMO,
    ),
    RoadUserFeature(
        name="speeding",
        unit="m/s",
        per="drives",
        unlikely="above",
        words="drives {value:.1f} m/s above the limit",
        # Mean 31 mph and 6 % above 40 mph, where 30 mph are allowed. Normal: choice.
        source="Department for Transport, Vehicle Speed Compliance Statistics, Great Britain: 2019",
        spread=NormalSpread(0.45, 2.6),
    ),
    RoadUserFeature(
        name="junction_gap",
        event="entry",
        unit="s",
        per="entries that have to yield",
        unlikely="below",
        words="drives {value:.1f} s before a vehicle that has priority",
        # A logit: 50 % accept 6.5 s and 85 % accept 8.25 s.
        source="Fitzpatrick 1991, Gaps Accepted at Stop-Controlled Intersections, TRR 1303",
        spread=LogisticSpread(6.5, 1.01),
    ),
    RoadUserFeature(
        name="red_entry",
        event="entry",
        unit="s",
        per="approaches to a red light",
        unlikely="above",
        words="enters {value:.1f} s after the start of red",
        # 6 to 29 of 100,000 crossing vehicles enter on red, 6 % of them after 2 s and 3 % after 5 s. The upper rate, of
        # the vehicles that reach the line within the first 2 s, the next 3 s or later. Choice: vehicles come evenly to
        # a signal that turns red once a minute and stays so for half of it; after 5 s it falls to a tenth in 20 s.
        source="Yang and Najm 2006, DOT HS 810 580: 47,000 entries on red",
        spread=UpperTail((0.0, 2.0, 5.0, 25.0), (1e-2, 2e-4, 2e-5, 2e-6)),
    ),
    RoadUserFeature(
        name="junction_stop",
        event="way through a junction",
        unit="s",
        per="ways through a junction",
        unlikely="above",
        words="stops in the junction for {value:.1f} s without a reason",
        source=SUMO,
    ),
    RoadUserFeature(
        name="junction_crawl",
        event="way through a junction",
        unit="s",
        per="ways through a junction",
        unlikely="above",
        words="crawls in the junction for {value:.1f} s without a reason",
        source=SUMO,
    ),
    RoadUserFeature(
        name="walking_speed",
        unit="m/s",
        per="crossings",
        unlikely="above",
        words="walks at {value:.1f} m/s",
        source="Weidmann 1993, Transporttechnik der Fussgänger; Fugger, Randles et al. 2000 measure N(1.36, 0.24)",
        spread=NormalSpread(1.34, 0.26),
    ),
    RoadUserFeature(
        name="walking_acceleration",
        unit="m/s²",
        per="starts",
        unlikely="above",
        words="starts walking by {value:.1f} m/s²",
        # 0.14 ± 0.09 g.
        source="Fugger, Randles et al. 2000, pedestrian gait at signal-controlled crosswalks: 288 subjects",
        spread=NormalSpread(1.37, 0.88),
    ),
    RoadUserFeature(
        name="riding_speed",
        unit="m/s",
        per="rides",
        unlikely="above",
        words="rides at {value:.1f} m/s",
        source=CHOICE,  # median 16.4 km/h; 1 in 100 rides faster than 29 km/h
        spread=LognormalSpread(4.56, 0.25),
    ),
    RoadUserFeature(
        name="riding_acceleration",
        unit="m/s²",
        per="starts",
        unlikely="above",
        words="starts riding by {value:.1f} m/s²",
        source=CHOICE,  # 1 in 10 exceeds what SUMO's class bicycle has at most
        spread=UpperTail((0.5, 1.2, 2.0), (1.0, 0.1, 1e-3)),
    ),
    RoadUserFeature(
        name="turn_rate",
        unit="rad/s",
        per="crossings",
        unlikely="above",
        words="turns by {value:.1f} rad/s",
        source=CHOICE,
        spread=UpperTail((0.0, 0.5, 2.0), (1.0, 0.1, 1e-3)),
    ),
    RoadUserFeature(
        name="crossing_gap",
        event="step onto the road",
        unit="s",
        per="crossings without priority",
        unlikely="below",
        words="steps out {value:.1f} s before the car",
        # Mean of the critical gap of young pedestrians, the least of all groups. Its spread, that of drivers: choice.
        source="Sahani, Saipriya and Bhuyan 2018, Transp. Dev. Econ. 4(2) 15",
        spread=LogisticSpread(5.31, 1.01),
    ),
    RoadUserFeature(
        name="towards_car",
        unit="s",
        per="crossings",
        unlikely="above",
        words="walks towards the car for {value:.1f} s",
        source=CHOICE,
        spread=UpperTail((0.0, 1.0, 4.0), (0.1, 0.01, 1e-4)),
    ),
    RoadUserFeature(
        name="stop_in_way",
        unit="s",
        per="crossings",
        unlikely="above",
        words="stands in the car's way for {value:.1f} s",
        source=CHOICE,
        spread=UpperTail((0.0, 1.0, 4.0), (0.1, 0.03, 1e-3)),
    ),
    RoadUserFeature(
        name="walks_on_red",
        event="step onto the road",
        unit="s",
        per="crossings at a signal",
        unlikely="above",
        words="steps out {value:.1f} s after the start of red",
        source="Araya-Porras, Mora-Calderón and Aguero-Valverde 2022, doi 10.15517/ri.v32i2.50386: 1,707 crossings",
        spread=UpperTail((0.0,), (0.106,)),
    ),
)
FEATURES: Mapping[str, RoadUserFeature] = {feature.name: feature for feature in _ROWS}


def tail_probability(feature: RoadUserFeature, spread: HasTails, value: float) -> float:
    """Computes the probability of values at least as unlikely, [`LEAST`, 1].

    Args:
      feature: tells the side of the unlikely values.
      spread: its own, or that of SUMO's drivers.
      value: in the feature's unit.
    """
    return max(spread.above(value) if feature.unlikely == "above" else spread.below(value), LEAST)
