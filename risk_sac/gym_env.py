"""Environment that Gymnasium makes by name: one family, any ego and ODD.

gymnasium.make("risk_sac.env.env:RiskSAC/Low-v0", ego="careful", odd={...}, render_mode="rgb_array")
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import EgoConfig, FamilyName, Odd
from risk_sac.config.spec_file import read_ego, read_spec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError, SimulationError
from risk_sac.failures.export.gif import EGO, OTHER, STRIKER, Canvas
from risk_sac.failures.net import shipped_net, shipped_surfaces
from risk_sac.scenario.bodies import body_of
from risk_sac.world.types import STEP_S, Role

RGB = "rgb_array"


class NamedEnv(RiskSacEnv):
    """A family's problem against an ego in an ODD."""

    metadata = {"render_modes": [RGB], "render_fps": round(1 / STEP_S)}  # noqa: RUF012  # Gymnasium's own declaration

    def __init__(
        self,
        family: FamilyName,
        ego: str | Mapping[str, Any] | EgoConfig | None = None,
        odd: Mapping[str, Any] | Odd | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Prepares, but starts no simulation.

        Args:
          family: low, mixed or dense.
          ego: as `--ego` takes it, such as "careful" or "idm-aeb+blind-right", or the fields of an `EgoConfig`.
          odd: the fields of an `Odd`.
          render_mode: "rgb_array" lets `render` draw the scene around the ego.

        Raises:
          ConfigError: one of these is unknown or out of range.
        """
        if render_mode not in (None, RGB):
            raise ConfigError("render_mode", f"{render_mode!r}", f"{RGB!r} or none")
        named = read_ego(ego) if isinstance(ego, str) else ego
        spec = read_spec(None, {"family": family, "ego": _fields(named), "odd": _fields(odd)})
        super().__init__(Problem.from_spec(spec), spec.learner.reward)
        self.render_mode = render_mode

    def render(self) -> NDArray[np.uint8] | None:
        """Draws the present frame.

        Returns:
          `height x width x 3`; None without a render mode.

        Raises:
          SimulationError: there is no episode yet.
        """
        if self.render_mode is None:
            return None
        if not hasattr(self, "trace"):
            raise SimulationError("the environment has no episode to draw; call reset first")
        frame, net = self.trace.frames[-1], shipped_net(self.layout.net)
        canvas = Canvas(np.array((frame.x_m[0], frame.y_m[0])))
        canvas.ground(shipped_surfaces(self.layout.net))
        if self._sim.running:
            canvas.heads(net, net.letters_by_signal(self.signal_heads()))
        for actor in reversed(range(len(frame.ids))):
            driven = frame.role[actor] == Role.ADVERSARY
            canvas.body(
                (frame.x_m[actor], frame.y_m[actor], frame.heading_rad[actor]),
                (frame.length_m[actor], frame.width_m[actor]),
                EGO if actor == 0 else STRIKER if driven else OTHER,
                person=body_of(int(frame.body[actor])).shape == "person",
                known=True,
            )
        return np.asarray(canvas.picture())


def _fields(given: Mapping[str, Any] | EgoConfig | Odd | None) -> Mapping[str, Any] | None:
    return given.model_dump(mode="json") if isinstance(given, EgoConfig | Odd) else given
