"""How far a campaign is: bars on a terminal, a plain line now and then elsewhere."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from risk_sac.cli.campaigns.output import figures, line
from risk_sac.cli.console import Board, notes
from risk_sac.client import Campaign

LINE_S = 10.0  # between two lines, unless the state changes
AT_WORK = ("running", "cancelling")


@contextmanager
def shown() -> Iterator[Callable[[Campaign], None]]:
    """What shows a campaign on standard error whenever it is called with it."""
    if not notes.is_interactive:
        yield _Lines()
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(15),
        MofNCompleteColumn(),
        TextColumn("{task.fields[found]}"),
    )
    with Progress(*columns, console=notes) as bar:
        board = Board(bar)

        def draw(campaign: Campaign) -> None:
            progress = campaign.progress
            runs = {run.id: (run.episodes_done, run.episodes_total) for run in campaign.runs if run.state in AT_WORK}
            board.show(progress.episodes_done, progress.episodes_total, figures(campaign), runs)

        yield draw


class _Lines:
    def __init__(self) -> None:
        self._state = ""
        self._said = 0.0

    def __call__(self, campaign: Campaign) -> None:
        now = time.monotonic()
        if campaign.state != self._state or now - self._said >= LINE_S:
            self._state, self._said = campaign.state, now
            notes.print(line(campaign), markup=False, soft_wrap=True)
