"""Renders pages from templates as HTML or Markdown, and formats their numbers.

A content template (`comparison.jinja`, `report.jinja`) calls the blocks of a layout (`html.jinja`, `markdown.jinja`).
Text that a template inserts is escaped for the layout; a template's own text is not.
"""

import base64
import math
import platform
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import count
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Literal

from markupsafe import Markup

from risk_sac.config import FamilyName, RunSpec
from risk_sac.metrics import COLUMNS, METRICS, RATIOS, Estimate, Metric, Ratio, requirement_cells, with_published
from risk_sac.records import DriverPcr
from risk_sac.report.comparison import DECLARED, REFERENCE, RIVALS, Comparison, declared, metrics_of
from risk_sac.report.runs import LIMITS, TESTED, Found, found_within
from risk_sac.report.statistics import LEVEL, pair_power

if TYPE_CHECKING:
    from jinja2 import Environment

Layout = Literal["html", "markdown"]
DASH = "–"
# For a browser that opens a page, as a file or from a server.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
# RISK-SAC's row of the paper's Table I, by family.
PAPER: dict[str, dict[FamilyName, float]] = {
    "ecr": {"low": 0.97, "mixed": 0.92, "dense": 0.89},
    "es": {"low": 0.94, "mixed": 0.88, "dense": 0.84},
    "rho_c": {"low": 0.15, "mixed": 0.25, "dense": 0.30},  # at most
    "ofd": {"low": 0.82, "mixed": 0.85, "dense": 0.92},
}
ROWS: Mapping[str, Metric | Ratio] = {row.name: row for row in (*METRICS, *RATIOS)}
# Control characters, what turns the direction of text, and halves of pairs.
_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")
# An underscore within a word and a bracket that begins no link are no marks.
_MARKS = re.compile(r"[\\`*|]|(?<!\w)_|_(?!\w)|\](?=[\[(:])")
_TAGS = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;"}
_FENCED_OR_BLANK = re.compile(r"(?ms)(^(`{3,})$.*?^\2$)|\n{3,}")


def table_markdown(comparison: Comparison) -> str:
    """Renders `table.md`."""
    return render("comparison", "markdown", comparison=comparison, spec=comparison.spec)


def render(content: str, layout: Layout, **context: object) -> str:
    """Renders a page; the same context gives the same text."""
    template = _environment(layout).get_template(f"{content}.jinja")
    text = template.render(layout=f"{layout}.jinja", number_of_block=count(1).__next__, **context)
    return _FENCED_OR_BLANK.sub(lambda block: block[1] or "\n\n", text).strip() + "\n"


@cache
def _environment(layout: Layout) -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined  # here: it loads in a tenth of a second

    environment = Environment(
        autoescape=True,
        extensions=["jinja2.ext.do"],
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=PackageLoader("risk_sac.report"),
        finalize=_visible if layout == "html" else _plain,
    )
    environment.filters |= {
        "degrees": math.degrees,
        "drivers": drivers,
        "estimate": estimate,
        "fenced": fenced,
        "found_within": found_within,
        "flat": lambda text: Markup(" ".join(text.split())),
        "inline": inline,
        "interval": interval,
        "number": number,
        "one_of": one_of,
        "percent": percent,
        "requirement": requirement_cells,
        "shares": shares,
        "spreads": spreads,
        "symbol": symbol,
        "tight": lambda text: Markup("\n".join(line for line in text.splitlines() if line.strip())),
        "with_published": with_published,
        "versions": lambda versions: ", ".join(map(" ".join, versions.items())) or DASH,
    }
    environment.tests["declared"] = declared
    environment.globals |= {
        "DASH": DASH,
        "POLICY": POLICY,
        "again": again,
        "declared_metrics": DECLARED,
        "figures": ROWS,
        "level": LEVEL,
        "limits": LIMITS,
        "metrics_of": metrics_of,
        "pair_power": pair_power,
        "paper": PAPER,
        "platform": platform_in_words,
        "reference": REFERENCE,
        "requirement_columns": COLUMNS,
        "rivals": RIVALS,
        "tested_limit": TESTED,
    }
    return environment


def _visible(value: object) -> object:
    """Replaces what cannot be seen; jinja escapes the rest."""
    return value if isinstance(value, Markup) else _UNSEEN.sub("\ufffd", str(value))


def _plain(value: object) -> Markup:
    """Escapes text for Markdown: one line without marks or HTML."""
    if isinstance(value, Markup):
        return value
    text = " ".join(str(_visible(value)).split()).translate(_TAGS)
    return Markup(_MARKS.sub(lambda mark: f"\\{mark[0]}", text))


def fenced(text: str) -> Markup:
    """Returns a block of code in a fence longer than any inside."""
    text = str(_visible(text)).strip()
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return Markup(f"{fence}\n{text}\n{fence}")


def inline(svg: bytes) -> str:
    """Returns a picture's data address; an SVG image runs and loads nothing."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"


def again(spec: RunSpec, spec_file: str) -> str:
    """Returns the command that repeats a run of the campaign in `spec_file`."""
    picked = ["--scenario", spec.family, "--method", spec.method, "--seed", str(spec.seed)]
    return shlex.join(["risk-sac", "run", "--spec", spec_file, *picked, "--out", "repeated"])


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """Returns a Markdown table: `left` columns of words, then numbers."""
    rule = ["---" if place < left else "---:" for place in range(len(columns))]
    lines = [columns, rule, *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def interval(low: float | None, high: float | None, format_: str = ".3f") -> str:
    """Formats an interval to follow a number; empty without one."""
    return "" if low is None or high is None else f" [{low:{format_}}, {high:{format_}}]"


def number(value: float | None, format_: str = ",d") -> str:
    """Formats a number; a dash without one."""
    return DASH if value is None else format(value, format_)


def percent(rate: float | None, decimals: int = 1) -> str:
    """Formats a rate in percent; a dash without one."""
    return DASH if rate is None else f"{100 * rate:.{decimals}f} %"


def one_of(counts: tuple[int, int] | None) -> str:
    """Formats a count and what it is of; a dash without them."""
    return DASH if counts is None else f"{counts[0]} of {counts[1]}"


def symbol(name: str) -> str:
    """Returns a figure's name in the head of a table."""
    return ROWS[name].symbol if name in ROWS else name


def estimate(value: Estimate, runs: int) -> str:
    """Formats a mean over seeds with interval, and how many if partial."""
    if value.mean is None:
        return DASH
    text = f"{value.mean:.3f}{interval(value.low, value.high)}"
    return text if value.runs == runs else f"{text} ({value.runs} of {runs} seeds)"


def shares(counts: Mapping[str, int], names: Sequence[str]) -> list[str]:
    """Formats names' counts and shares of all counts; dashes without counts."""
    judged = sum(counts.values())
    return [f"{counts.get(name, 0)} ({percent(counts.get(name, 0) / judged, 0)})" if judged else DASH for name in names]


def spreads(runs: Sequence[Found]) -> list[str]:
    """Formats each count: median over runs, least and most."""
    return [f"{median(values):g} ({min(values)}–{max(values)})" for values in zip(*runs, strict=True)]


def drivers(rates: Mapping[str, DriverPcr], names: Sequence[str]) -> list[str]:
    """Formats each reference driver's PCR; a dash if it judged no contact."""
    told = [rates.get(name) for name in names]
    return [f"{rate.pcr:.3f}{interval(rate.pcr_low, rate.pcr_high)}" if rate else DASH for rate in told]


_CPU_INFO = Path("/proc/cpuinfo")


def this_platform() -> Mapping[str, str]:
    """Returns architecture, processor and Python, which affect seconds and digests' last bits."""
    return {"machine": platform.machine(), "cpu": _cpu(), "python": platform.python_version()}


def platform_in_words() -> str:
    """Describes this machine on one line."""
    here = this_platform()
    return f"{here['machine']}, {here['cpu']}, Python {here['python']}"


def _cpu() -> str:
    """Python knows no model name on Linux, the kernel does."""
    lines = _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines() if _CPU_INFO.exists() else []
    names = (
        value.strip() for name, _, value in (line.partition(":") for line in lines) if name.strip() == "model name"
    )
    return next(names, "") or platform.processor() or "unknown"
