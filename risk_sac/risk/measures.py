"""Risk measures of a frame; measuring does not act on the simulation."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from risk_sac.config import Requirement
from risk_sac.maps.carriageway import Carriageway
from risk_sac.risk.publish import Assessment, OwnMotionGauge, assess, publish
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.risk.stl import Monitor
from risk_sac.world.jit import compiled
from risk_sac.world.types import STEP_S, Bools, Floats, Frame


@compiled
def soft_min(robustness: Floats, beta: float) -> float:
    """Soft minimum of the requirements' robustness, ρ(Φ, s).

    ρ(Φ, s) = -(1/β) log Σ_i exp(-β ρ_i)                                             (7)

    Args:
      robustness: `M`, M ≥ 1, scaled; below 0 means violated.
      beta: sharpness β > 0; larger is closer to the true minimum.

    Returns:
      A value in [min_i ρ_i - log(M)/β, min_i ρ_i].

    Source: RISK-SAC, Sec. III-C.
    """
    least = robustness.min()  # taken out so that exp cannot overflow
    summed = 0.0
    for value in robustness:
        summed += math.exp(beta * (least - value))
    return float(least - math.log(summed) / beta)


class Measures(NamedTuple):
    """Risk measures of one frame, and the robustness of the requirements."""

    assessment: Assessment
    signals: dict[str, float]
    robustness: Floats  # M, scaled
    soft_min: float


class Gauge:
    """Gauge that measures an episode's frames in order, as requirements have memory.

    Attributes:
      names: of the requirements, in the order of their robustness.
    """

    def __init__(
        self, requirements: Sequence[Requirement], horizon_steps: int, rss: RssParameters, softmin_sharpness: float
    ) -> None:
        """Compiles the requirements; `softmin_sharpness` is β of (7)."""
        self._monitor = Monitor(requirements, STEP_S, horizon_steps)
        self._own = OwnMotionGauge()
        self._horizon_steps = horizon_steps
        self._rss = rss
        self._sharpness = softmin_sharpness
        self.names = self._monitor.names

    def reset(self, carriageway: Carriageway) -> None:
        """Forgets the previous episode; the next is on this carriageway's net."""
        self._monitor.reset()
        self._own.reset(carriageway)

    def measure(self, frame: Frame, before: Frame | None, seen: Bools, struck: int = 0) -> Measures:
        """Measures the next frame, given the one before.

        `seen` says which others the ego sees; `struck` is the column of one that it has touched, or 0.
        """
        assessment = assess(frame, self._rss, seen, struck)
        signals = publish(frame, before, assessment.least, self._own.measure(frame))
        robustness = self._monitor.update(signals)
        return Measures(assessment, signals, robustness, soft_min(robustness[self._monitor.shapes], self._sharpness))

    def remember(self, frame: Frame, signals: Mapping[str, float]) -> None:
        """Takes over the next frame, of which the signals were measured before."""
        self._own.remember(frame)
        self._monitor.update(signals)

    def of(self, requirement: Requirement) -> "Gauge":
        """Returns a gauge of one requirement here, with its own memory."""
        alone = requirement.model_copy(update={"shapes": True})  # the soft minimum needs one that does
        gauge = Gauge((alone,), self._horizon_steps, self._rss, self._sharpness)
        gauge.reset(self.carriageway)
        return gauge

    @property
    def signals(self) -> Sequence[str]:
        """Names of the signals that the requirements speak about."""
        return self._monitor.signals

    @property
    def carriageway(self) -> Carriageway:
        """The carriageway of the net."""
        return self._own.carriageway
