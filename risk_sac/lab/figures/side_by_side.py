"""Plays runs side by side and writes a row for each."""

import csv
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any, TypeVar

Row = dict[str, Any]
Run = TypeVar("Run")


def rows_of(play: Callable[[Run], Row], runs: Sequence[Run], jobs: int, file: Path) -> list[Row]:
    """Plays each run in a process of its own, in order, and rewrites a CSV file after each.

    Args:
      play: plays a run unless it was played before, and returns its row.
      runs: to play.
      jobs: processes at a time.
      file: of the rows of the runs that have ended so far.

    Returns:
      A row per run.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    rows: dict[int, Row] = {}
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), max_tasks_per_child=1) as pool:
        tasks = {pool.submit(play, run): place for place, run in enumerate(runs)}
        for task in as_completed(tasks):
            rows[tasks[task]] = task.result()
            write_rows(file, [rows[place] for place in sorted(rows)])
    return [rows[place] for place in sorted(rows)]


def write_rows(file: Path, rows: Sequence[Row]) -> None:
    """Writes rows with the same columns as a CSV file."""
    with file.open("w", newline="") as stream:
        table = csv.DictWriter(stream, rows[0].keys(), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
