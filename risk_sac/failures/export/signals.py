"""What the signals show, as cycles that the open formats can say."""

from risk_sac.failures.export.recorded import Recorded
from risk_sac.types import STEP_S

COLOURS = {"r": "red", "u": "red_yellow", "y": "yellow", "g": "green", "o": "off", "s": "green"}
"""SUMO's letter, in lower case → colour; o and O are a signal that is off."""


def cycle(failure: Recorded, signal: str) -> list[tuple[int, str]]:
    """Steps and letters of a signal's phases from the first frame on.

    Its program, which begins where it was then; where something else was recorded, that, which then ends the list.
    """
    shown = [bytes(row).decode() for row in failure.heads[signal]]
    program = failure.net.signals[signal]
    steps = round(program.cycle_s / STEP_S)
    turning = [program.letters(failure.offset_s(signal, frame)) for frame in range(max(steps, len(shown)))]
    return _runs(turning[:steps] if turning[: len(shown)] == shown else shown)


def _runs(letters: list[str]) -> list[tuple[int, str]]:
    runs: list[tuple[int, str]] = []
    for each in letters:
        if runs and runs[-1][1] == each:
            runs[-1] = (runs[-1][0] + 1, each)
        else:
            runs.append((1, each))
    return runs


def colour(letter: str) -> str:
    """Of one of SUMO's letters."""
    return COLOURS.get(letter.lower(), "off")
