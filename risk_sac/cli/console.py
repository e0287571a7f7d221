"""Exit statuses, tables, bars and JSON that the commands share."""

import argparse
import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import BaseModel, TypeAdapter
from pydantic_core import to_json
from rich.box import SIMPLE_HEAD
from rich.console import RenderableType
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table

from risk_sac.config.spec_file import EGO_FILE, EGO_NAMES
from risk_sac.host.terminal import Output, console, notes
from risk_sac.metrics import requirement_cells
from risk_sac.records import Adjustment, Collision, DrivenBy, EpisodeRecord, RequirementCounts, Violation
from risk_sac.run_folder.durable import replace_file

OK, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130
ABOVE, COULD_NOT_RUN = 1, 2  # of `risk-sac campaigns`, which gates CI jobs
Answer: TypeAlias = BaseModel | Sequence[BaseModel | Mapping[str, Any]] | Mapping[str, Any]
"""What a command prints with `--json`."""


def print_answer(options: argparse.Namespace, answer: Answer, *texts: RenderableType) -> None:
    """Prints an answer as one JSON document with `--json`, else the texts."""
    if options.json:
        plain = TypeAdapter(Any).dump_python(answer)  # else models keep their own way to write NaN
        console.out(to_json(plain, inf_nan_mode="null").decode(), highlight=False)
        return
    for text in texts:
        say(text)


def say(text: RenderableType) -> None:
    """Prints a table, or text wrapped at spaces; long paths stay whole."""
    if isinstance(text, str):
        lines = (_wrapped(line, console.width) for line in text.splitlines())
        console.print("\n".join(lines), markup=False, soft_wrap=True)
    else:
        console.print(text)


def _wrapped(line: str, width: int) -> str:
    indent = " " * (len(line) - len(line.lstrip()) + 2) if line.startswith(" ") else ""
    return textwrap.fill(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def number(type_: type[int] | type[float], least: float, most: float = math.inf) -> Callable[[str], float]:
    """Type of an argument that is a number in [least, most]."""

    def parsed(text: str) -> float:
        value = type_(text)
        if not (least <= value <= most and math.isfinite(value)):
            wanted = f"{least:g} or more" if most == math.inf else f"{least:g} to {most:g}"
            raise argparse.ArgumentTypeError(f"got {text!r}; wanted {wanted}")
        return value

    parsed.__name__ = "number"  # so argparse calls it
    return parsed


def write_out(file: Path, content: bytes, what: str = "", said_on: Output = console) -> None:
    """Writes a user's file with missing folders, and says so."""
    file.parent.mkdir(parents=True, exist_ok=True)
    replace_file(file, content)
    if what:
        said_on.print(f"{what}: {file}", markup=False, soft_wrap=True)


def columns(bar: BarColumn) -> tuple[ProgressColumn, ...]:
    """Returns columns around a bar; `found`, the findings, wraps on narrow terminals."""
    found = TextColumn("{task.fields[found]}", table_column=Column(no_wrap=False))
    return TextColumn("{task.description}"), bar, MofNCompleteColumn(), found


def progress_bar() -> Progress:
    """Returns bars with remaining time; draws nothing without a terminal."""
    return Progress(*columns(BarColumn()), TimeRemainingColumn(), console=notes, disable=not notes.is_terminal)


class Board:
    """One bar for all runs, and one for each run at work."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._all = bar.add_task("all runs", total=None, found="")
        self._tasks: dict[str, TaskID] = {}

    def show(self, done: int, total: int, found: str, at_work: Mapping[str, tuple[int, int]]) -> None:
        """Draws the state; `at_work` has done and total by run name."""
        self._bar.update(self._all, completed=done, total=total, found=found)
        for name in self._tasks.keys() - at_work.keys():
            self._bar.remove_task(self._tasks.pop(name))
        for name, (its_done, its_total) in at_work.items():
            if name not in self._tasks:
                self._tasks[name] = self._bar.add_task(name, total=its_total, found="")
            self._bar.update(self._tasks[name], completed=its_done)


def narrow_table(*columns: str, **style: Any) -> Table:
    """Returns an empty table without lines; only the last column wraps."""
    unwrapped = (Column(name, no_wrap=name != columns[-1]) for name in columns)
    return Table(*unwrapped, box=SIMPLE_HEAD, padding=0, **style)


def say_adjustments(found: Iterable[Adjustment]) -> None:
    """Says what episodes use otherwise than it was asked for."""
    for each in found:
        notes.print(f"Note: {each}.", markup=False, soft_wrap=True)


def folded_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Returns a table that folds all cells except the first column's."""
    table = Table(*columns, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.columns[0].no_wrap = True
    for row in rows:
        table.add_row(*map(escape, row))
    return table


REQUIREMENT_HEADS = ("requirement", "counts", "vio-\nlated", "valid", "dis-\ntinct", "preven-\ntable", "rate\n95 %")


def requirements_table(
    groups: Mapping[str, Mapping[str, RequirementCounts]], said: Mapping[tuple[str, str], str] | None = None
) -> Table | None:
    """Returns requirements' rows below their groups, in 80 columns, or None.

    Args:
      groups: by name, their requirements.
      said: by group and requirement, what is said below its rate, in red.
    """
    if not any(groups.values()):
        return None
    table = Table(box=SIMPLE_HEAD, padding=0)
    for place, head in enumerate(REQUIREMENT_HEADS):
        words = place < 2
        table.add_column(head, no_wrap=place > 0, overflow="fold", justify="left" if words else "right")
    for group, requirements in groups.items():
        if requirements:
            table.add_row(group)
        for name, found in requirements.items():
            above = (said or {}).get((group, name))
            cells = requirement_cells(f"  {name}", found)
            table.add_row(*cells[:-1], f"{cells[-1]}\n{above}" if above else cells[-1], style="red" if above else None)
    return table


def or_dash(value: float | None, format_: str) -> str:
    """A number, or a dash where there is none."""
    return format(value, format_) if value is not None and math.isfinite(value) else "-"


# What names an ego.
EGO = f"{EGO_NAMES}, or {EGO_FILE}"


def on_one_line(text: str) -> str:
    """Returns the text with single spaces for all white space."""
    return " ".join(text.split())


def counted(count: int, noun: str) -> str:
    """A count with its noun: `1 failure`, `2 failures`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def headline(found: int | None, candidates: int, published: int | None) -> str:
    """Formats the headline count; before replay "at most" the candidates.

    `published` are those that R157, FSM or RSS prevents.
    """
    if found is None:
        return f"at most {candidates}" if candidates else "0"
    return f"{found}, {published or 0} of them preventable by R157, FSM or RSS" if found else "0"


def driven_by_in_words(counts: Mapping[str, int]) -> str:
    """Formats counts by `DrivenBy`, as `policy 41, script 137`; dash without any."""
    return ", ".join(f"{each} {counts[each]}" for each in DrivenBy if counts.get(each)) or "-"


def offences(violation: Collision | Violation) -> Iterator[str]:
    """Yields a line of the ego's offences, and one of the other's."""
    if isinstance(violation, Violation):
        broken = {"ego": violation.broke}
    else:
        broken = {"ego": violation.judgement.ego_broke, "other": violation.judgement.broke}
    yield from (f"{actor}: {in_words(broke)}" for actor, broke in broken.items() if broke)


OUTCOME = "outcome\ngrade\nplausibility\nseverity\nfault\ndriven by"


def outcome(episode: EpisodeRecord, violation: Collision | Violation) -> str:
    """The cell below `OUTCOME`, with as many lines as there are."""
    severity = violation.severity if isinstance(violation, Collision) else None
    fault = f"fault: {violation.blamed}" if violation.blamed else None
    plausibility = None if violation.behaviour is None else violation.behaviour.verdict
    lines = (episode.outcome, violation.graded, plausibility, severity, fault, episode.driven_by)
    return "\n".join(str(line) for line in lines if line)


def in_words(names: Iterable[str]) -> str:
    """Names of rules or of what was broken, as words."""
    return ", ".join(names).replace("_", " ")
