"""What the commands share: where they print, and what their exit statuses mean."""

import argparse
from collections.abc import Mapping
from typing import TypeAlias

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from risk_sac.cli.text import printable

OK, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130
ABOVE, COULD_NOT_RUN = 1, 2  # of `risk-sac campaigns`, which gates CI jobs
console = Console(highlight=False)
notes = Console(stderr=True, highlight=False)
errors = Console(stderr=True, highlight=False, soft_wrap=True)

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""Where a group of commands adds its parsers."""


def complain(message: str) -> None:
    """Prints what went wrong."""
    errors.print(printable(message), style="red", markup=False)


def progress_bar() -> Progress:
    """Bars with a field `found` for what the search has found."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[found]}"),
        TimeRemainingColumn(),
        console=console,
    )


class Board:
    """One bar for all runs, and one for each run at work."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._all = bar.add_task("all runs", total=None, found="")
        self._tasks: dict[str, TaskID] = {}

    def show(self, done: int, total: int, found: str, at_work: Mapping[str, tuple[int, int]]) -> None:
        """Draws the present state.

        Args:
          done: episodes of all runs.
          total: the same, once they have ended.
          found: said beside them.
          at_work: done and total of each run at work, by its name.
        """
        self._bar.update(self._all, completed=done, total=total, found=found)
        for name in self._tasks.keys() - at_work.keys():
            self._bar.remove_task(self._tasks.pop(name))
        for name, (its_done, its_total) in at_work.items():
            if name not in self._tasks:
                self._tasks[name] = self._bar.add_task(name, total=its_total, found="")
            self._bar.update(self._tasks[name], completed=its_done)


def or_dash(value: float | None, format_: str) -> str:
    """A number, or a dash where there is none."""
    return "-" if value is None else format(value, format_)
