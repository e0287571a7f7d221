"""Formats tables and numbers in Markdown, and describes the machine."""

import platform
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

DASH = "–"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """The first columns hold words, the others numbers."""
    rule = ["---" if place < left else "---:" for place in range(len(columns))]
    lines = [columns, rule, *rows]
    return "\n".join(f"| {' | '.join(_escaped(cell) for cell in line)} |" for line in lines) + "\n"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def interval(low: float | None, high: float | None, format_: str = ".3f") -> str:
    """Behind a number; nothing where there is none."""
    return "" if low is None or high is None else f" [{low:{format_}}, {high:{format_}}]"


def number(value: float | None, format_: str) -> str:
    """A number, or a dash."""
    return DASH if value is None else format(value, format_)


def percent(rate: float, decimals: int = 1) -> str:
    """Of a rate."""
    return f"{100 * rate:.{decimals}f} %"


def versions_in_words(versions: Mapping[str, str]) -> str:
    """Packages with their versions."""
    return ", ".join(f"{name} {version}" for name, version in versions.items())


_CPU_INFO = Path("/proc/cpuinfo")


def this_platform() -> Mapping[str, str]:
    """Architecture, processor and Python of this machine: what seconds, and the last bits of a digest, depend on."""
    return {"machine": platform.machine(), "cpu": _cpu(), "python": platform.python_version()}


def platform_in_words() -> str:
    """The same on one line."""
    here = this_platform()
    return f"{here['machine']}, {here['cpu']}, Python {here['python']}"


def _cpu() -> str:
    """Python knows no model name on Linux, the kernel does."""
    lines = _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines() if _CPU_INFO.exists() else []
    names = (
        value.strip() for name, _, value in (line.partition(":") for line in lines) if name.strip() == "model name"
    )
    return next(names, "") or platform.processor() or "unknown"
