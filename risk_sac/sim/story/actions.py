"""All actions of a story: their classes, and those over at once."""

from collections.abc import Callable, Mapping
from typing import Any

from risk_sac.config.story_actions import Action, VariableAction
from risk_sac.sim.story.across import (
    AcquirePosition,
    AssignRoute,
    ChangeLane,
    ChangeOffset,
    FollowTrajectory,
    KeepBeside,
)
from risk_sac.sim.story.along import ChangeSpeed, FollowProfile, KeepAhead, Synchronise
from risk_sac.sim.story.cast import Mover
from risk_sac.sim.story.stage import ACROSS, ALONG, NEITHER, Doing, Stage


class Once:
    """An action that is over at once."""

    def __init__(self, do: Any) -> None:
        """Takes the action."""
        self._do = do
        self.controls = {"teleport": ACROSS, "delete": ALONG | ACROSS}.get(do.kind, NEITHER)

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.begin`."""
        if self._do.kind == "teleport":
            mover.guided, mover.lateral_mps = False, 0.0
            stage.onto_road(mover, stage.pose(self._do.position))
            stage.look_again(mover.name)
        elif self._do.kind == "visibility":
            mover.visible = self._do.traffic, self._do.sensors
        elif self._do.kind == "delete":
            mover.gone = True
            stage.present.pop(mover.name, None)
        return True

    def step(self, mover: Mover, stage: Stage) -> bool:
        """See `Doing.step`."""
        return True


CLASSES: Mapping[str, Callable[[Any], Doing]] = {
    "speed": ChangeSpeed,
    "speed_profile": FollowProfile,
    "longitudinal_distance": KeepAhead,
    "synchronise": Synchronise,
    "lane_change": ChangeLane,
    "lane_offset": ChangeOffset,
    "lateral_distance": KeepBeside,
    "follow_trajectory": FollowTrajectory,
    "assign_route": AssignRoute,
    "acquire_position": AcquirePosition,
    "teleport": Once,
    "visibility": Once,
    "delete": Once,
    "none": Once,
}
"""Kind of an action of actors → class that does it."""


def doing_of(action: Action) -> Doing:
    """Returns what does an action of an actor."""
    return CLASSES[action.kind](action)


def set_variable(action: VariableAction, stage: Stage) -> None:
    """Sets or changes a variable."""
    name, value = action.variable, float(action.value)
    if action.word is not None:
        stage.words[name] = action.word
    elif action.how == "set":
        stage.numbers[name] = value
    else:
        before = stage.numbers.get(name, 0.0)
        stage.numbers[name] = before + value if action.how == "add" else before * value
