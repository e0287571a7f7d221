"""`python -m tests.acceptance.readme`: compares README.md's commands with what a clone prints.

A file is saved first where the page says "Save this as". Numbers, plurals and blanks may differ, since another kind of
processor plays other episodes. `…` stands for any text. The commands run in one shell, so `source .venv/bin/activate`
lasts.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.server import ROOT

CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.M | re.S)
SAVED = re.compile(r"Save this as `([^`]+)`[^`]*^```\w+\n(.*?)^```$", re.M | re.S)
ENDED = "README ended:"


@dataclass(frozen=True)
class Step:
    """A command, and the lines that README.md shows below it."""

    command: str
    shown: tuple[str, ...] = ()


def steps(text: str) -> Iterator[Step]:
    """Yields the commands in their order."""
    for block in CONSOLE.findall(text):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, *shown = part.splitlines()
            yield Step(command, tuple(shown))


def save(text: str, folder: Path) -> None:
    """Saves the files that a page shows into a folder."""
    for name, content in SAVED.findall(text):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content, encoding="utf-8")


def pattern(line: str) -> str:
    """Returns an expression for a line with any numbers, plurals and blanks."""
    words = (re.sub(r"\d+(\\\.\d+)?", r"[\\d.]+", re.escape(word)) for word in line.split())
    return r"\s+".join(re.sub(r"failures?", "failures?", word) for word in words)


def agrees(printed: str, shown: tuple[str, ...]) -> bool:
    """Returns whether these lines were printed in order, adjacent unless `…` separates."""
    parts = "\n".join(shown).split("…")
    expressions = [r"\s+".join(pattern(line) for line in part.splitlines() if line.strip()) for part in parts]
    return re.search(".*".join(expressions), printed, re.S) is not None


def run(clone: Path, wanted: list[Step]) -> list[str]:
    """Runs the commands in one shell in a clone; returns their outputs.

    Raises:
      AssertionError: one ended with a status other than 0.
    """
    script = "\n".join(f"{step.command}\necho '{ENDED}'" for step in wanted)
    environment = {name: value for name, value in os.environ.items() if name != "VIRTUAL_ENV"} | {"COLUMNS": "80"}
    shell = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        cwd=clone,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    printed = shell.stdout.split(f"{ENDED}\n")
    assert shell.returncode == 0, f"{wanted[len(printed) - 1].command}\n{printed[-1][-4000:]}"
    return printed[:-1]


def check(clone: Path, wanted: list[Step]) -> None:
    """Runs the commands and compares.

    Raises:
      AssertionError: a command failed, printed something else, or left a file in the clone's root.
    """
    before = set(os.listdir(clone))
    for step, printed in zip(wanted, run(clone, wanted), strict=True):
        assert agrees(printed, step.shown), f"$ {step.command}\n{printed}\nREADME shows\n" + "\n".join(step.shown)
    left = {name for name in os.listdir(clone) if not name.startswith(".") and not name.endswith(".egg-info")}
    assert left - before <= {"results"}, left - before


def cloned(folder: Path) -> Path:
    """Clones the last commit."""
    clone = folder / "risk-sac"
    subprocess.run(["git", "clone", "--quiet", "--no-hardlinks", str(ROOT), str(clone)], check=True)
    return clone


def main() -> None:
    """Runs all commands, the installation and the suite among them."""
    with tempfile.TemporaryDirectory() as folder:
        clone = cloned(Path(folder))
        text = (clone / "README.md").read_text(encoding="utf-8")
        save(text, clone)
        check(clone, list(steps(text)))
    print("README.md: all commands print what it shows")


if __name__ == "__main__":
    sys.exit(main())
