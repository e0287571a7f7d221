"""Counts of the repository against its limits: `python -m tests.size`."""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
GENERATED = "_pb2"
LAB = "risk_sac/lab/"  # training, benchmarks and measured figures: the product never imports it


def counts() -> Iterator[tuple[str, int, int]]:
    """Yields what is counted, its count in tracked files, and its limit."""
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    python = [name for name in tracked if name.endswith(".py") and GENERATED not in name and (ROOT / name).exists()]
    lab = [name for name in python if name.startswith(LAB)]
    product = [name for name in python if name.startswith(("risk_sac/", "service/")) and name not in lab]
    markdown = [name for name in tracked if name.endswith(".md") and (ROOT / name).exists()]
    yield "product lines", _lines(product), 44_000
    yield "product files", len(product), 260
    yield "lab lines", _lines(lab), 3_500
    yield "test lines", _lines([name for name in python if name.startswith("tests/")]), 34_000
    yield "Markdown words", sum(len(_text(name).split()) for name in markdown), 30_000


def _lines(names: Sequence[str]) -> int:
    return sum(len(_text(name).splitlines()) for name in names)


def _text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


if __name__ == "__main__":
    too_large = False
    for what, count, limit in counts():
        too_large |= count > limit
        print(f"{what:15} {count:7,} of {limit:,}{' (too many)' if count > limit else ''}")
    sys.exit(too_large)
