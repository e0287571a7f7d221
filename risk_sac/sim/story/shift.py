"""Start triggers of events that fire some seconds later or earlier than the story has them."""

from collections.abc import Iterable

from risk_sac.config.story import StoryEvent
from risk_sac.scenario.layout import is_shifted
from risk_sac.sim.story.stage import Stage
from risk_sac.sim.story.triggers import StoryState, TriggerWatch
from risk_sac.world.types import STEP_S


class EventStart:
    """Start of one execution of an event.

    Choice: a trigger comes earlier by `s` where it would fire `s` from now if all actors went on at their velocities,
    and at the latest where it fires. One that would fire in this way only, and never does, has begun the event all the
    same.
    """

    def __init__(self, event: StoryEvent) -> None:
        """Prepares; nothing was evaluated yet."""
        self._event = event
        self._watch = TriggerWatch(event.start) if event.start else None
        self._early = TriggerWatch(event.start) if event.start else None
        self._due_s: float | None = None

    def fires(self, stage: Stage, board: StoryState, actors: Iterable[str]) -> bool:
        """Evaluates it now, for the event's actors; the shift is that of the first that has one."""
        if self._watch is None or self._early is None:
            return True
        fires = self._watch.check(stage, board)[0]
        shifts_s = stage.plan.shifts_s
        shift_s = next((shifts_s[name] for name in actors if name in shifts_s), 0.0)
        if abs(shift_s) < STEP_S / 2 or not is_shifted(self._event):
            return fires
        shifted = [stage.movers[name] for name in actors if name in stage.movers]
        if shift_s < 0.0:
            before = self._early.check(stage.after(-shift_s), board)[0] and not fires
            if before:
                for mover in shifted:
                    mover.note_shift(shift_s)
            return fires or before
        if fires and self._due_s is None:
            self._due_s = stage.time_s + shift_s
            for mover in shifted:
                mover.note_shift(shift_s)
        return self._due_s is not None and stage.time_s >= self._due_s - STEP_S / 2
