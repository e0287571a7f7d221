"""Straight road of three lanes, and stories under a constant-speed ego."""

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import TypeAdapter

from risk_sac.config.story import Condition, Story, StoryAct
from risk_sac.scenario.layout import Reach, StoryActor, StoryPlan
from risk_sac.scenario.places import StoryPlaces
from risk_sac.scenario.space import Value
from risk_sac.scenario.travel_line import Pose
from risk_sac.sim.story.cast import NO_LEADS, Lead, Present
from risk_sac.sim.story.traffic import StoryEngine, StoryMotion
from risk_sac.world.net import Edge, Net, NetLane
from risk_sac.world.types import STEP_S

WIDTH_M = 3.5
CAR = Reach(4.0, 2.0, 1.0)
POINT = Reach(0.0, 0.0)
ORIGIN = Pose(0.0, 0.0, 0.0)


def straight_net(lanes: int = 3, length_m: float = 5000.0) -> Net:
    """Road east from the origin; lane `i` has y = 3.5 i."""
    net = Net()
    own = tuple(
        NetLane(
            id=f"road_{i}",
            edge="road",
            index=i,
            length_m=length_m,
            width_m=WIDTH_M,
            limit_mps=50.0,
            line=((0.0, WIDTH_M * i), (length_m, WIDTH_M * i)),
            drivable=True,
        )
        for i in range(lanes)
    )
    net.lanes.update({lane.id: lane for lane in own})
    net.edges["road"] = Edge("road", "a", "b", own)
    return net


def story_of(acts: Sequence[Mapping[str, Any]] = (), **parts: Any) -> Story:
    """A story of acts as a document writes them."""
    return Story.model_validate({"stories": {"story": list(acts)}, **parts})


def one_event(actor: str, *do: Mapping[str, Any], start: Any = None, **event: Any) -> dict[str, Any]:
    """An act with one event of one actor."""
    actions = [{"name": f"action{i}", "do": each} for i, each in enumerate(do)]
    one = {"name": "event", "actions": actions, "start": start, **event}
    return {"name": "act", "groups": [{"actors": [actor], "maneuvers": [{"events": [one]}]}]}


def after(time_s: float, **more: Any) -> list[list[dict[str, Any]]]:
    """A trigger by time."""
    return [[{"kind": "time", "rule": "greater_or_equal", "value": time_s, **more}]]


def condition(**fields: Any) -> Condition:
    """A condition as a document writes it."""
    return TypeAdapter(Condition).validate_python(fields)


def act(**fields: Any) -> StoryAct:
    """An act as a document writes it."""
    return StoryAct.model_validate(fields)


class Drive:
    """Story on the straight road under an ego at constant speed."""

    def __init__(
        self,
        story: Story,
        actors: Mapping[str, StoryActor],
        *,
        ego_mps: float = 10.0,
        ego: Pose = ORIGIN,
        reach: Reach = CAR,
        others: Mapping[str, Present] | None = None,
        numbers: Mapping[str, float] | None = None,
        words: Mapping[str, str] | None = None,
        shifts_s: Mapping[str, float] | None = None,
    ) -> None:
        self.ego_mps, self._ego, self._reach, self._others = ego_mps, ego, reach, dict(others or {})
        plan = StoryPlan(
            story=story,
            actors=actors,
            places=StoryPlaces(straight_net(), None, story, Value({}, {})),
            numbers=numbers or {},
            words=words or {},
            shifts_s=shifts_s or {},
        )
        self.engine = StoryEngine(plan, self.present())
        self.engine.observe(self.present())
        self.history: list[Mapping[str, StoryMotion]] = [self.engine.played]

    def present(self) -> dict[str, Present]:
        time_s = self.engine.time_s if hasattr(self, "engine") else 0.0
        pose = self._ego._replace(x_m=self._ego.x_m + self.ego_mps * time_s)
        return {"ego": Present.moving(pose, self.ego_mps, 0.0, self._reach), **self._others}

    def to(self, time_s: float, leads: Mapping[str, Lead] = NO_LEADS) -> Mapping[str, StoryMotion]:
        """Plays on to a time; returns where the story's actors are."""
        while self.engine.time_s < time_s - STEP_S / 2:
            self.engine.advance(leads)
            self.engine.observe(self.present())
            self.history.append(self.engine.played)
        return self.engine.played


def car(x_m: float, lane: int = 0, speed_mps: float = 10.0, reach: Reach = CAR, **more: Any) -> StoryActor:
    """Story car whose reference point is in a lane's middle at `x_m`."""
    return StoryActor(Pose(x_m, WIDTH_M * lane, 0.0), speed_mps, reach, **more)
