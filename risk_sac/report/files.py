"""Write a comparison: JSON with everything, CSV with one row per cell and phase, Markdown and figures."""

import csv
import io
import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from risk_sac.metrics import METRICS
from risk_sac.report.cells import Cell
from risk_sac.report.comparison import Comparison
from risk_sac.report.figures import FORMATS, figure_files, figure_names
from risk_sac.report.markdown import table_markdown
from risk_sac.report.page import this_platform
from risk_sac.report.runs import FinishedRun
from risk_sac.run_folder.durable import replace_file

FIGURES = "figures"
FORMAT_VERSION = 1
_PLAIN = tuple(each.name for each in fields(Cell) if each.type in (int, float, float | None))  # a column each


def write_report(comparison: Comparison, folder: Path) -> None:
    """Replaces `table.json`, `table.md`, `table.csv` and `figures/` in a folder.

    Raises:
        OSError: it cannot be written.
    """
    files = {
        "table.json": table_json(comparison).encode(),
        "table.md": table_markdown(comparison).encode(),
        "table.csv": table_csv(comparison).encode(),
    }
    for name in figure_names(comparison):
        for format_, content in zip(FORMATS, figure_files(comparison, name), strict=True):
            files[f"{FIGURES}/{name}.{format_}"] = content
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        replace_file(folder / name, content)


def document(comparison: Comparison) -> dict[str, Any]:
    """What `table.json` holds."""
    return {
        "format_version": FORMAT_VERSION,
        "command": comparison.command,
        "spec_digest": comparison.spec.digest,
        "spec": comparison.spec.model_dump(mode="json"),
        "versions": dict(comparison.versions),
        "platform": dict(this_platform()),
        "complete": not comparison.missing,
        "missing": [
            {"family": run.spec.family, "method": run.spec.method, "seed": run.spec.seed, "reason": run.reason}
            for run in comparison.missing
        ],
        "reference": comparison.reference,
        "cells": [asdict(cell) for cell in comparison.cells],
        "tests": [asdict(test) for test in comparison.tests],
        "headline": [asdict(test) for test in comparison.headline],
        "failures": {family: each.model_dump(mode="json") for family, each in comparison.overviews.items()},
        "studies": {
            family: {id_: each.model_dump(mode="json") for id_, each in comparison.studies(family).items()}
            for family in comparison.overviews
        },
        "runs": [_row(run) for run in comparison.runs],
    }


def table_json(comparison: Comparison) -> str:
    """`table.json`."""
    return json.dumps(document(comparison), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def table_csv(comparison: Comparison) -> str:
    """`table.csv`; empty where there is no value."""
    text = io.StringIO()
    names = ["family", "method", "phase", "runs", *_PLAIN]
    for metric in METRICS:
        names += [metric.name, f"{metric.name}_low", f"{metric.name}_high", f"{metric.name}_runs"]
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(_cell_row(cell) for cell in comparison.cells)
    return text.getvalue()


def _cell_row(cell: Cell) -> dict[str, Any]:
    row: dict[str, Any] = {"family": cell.family, "method": cell.method, "phase": cell.phase, "runs": len(cell.seeds)}
    row |= {name: getattr(cell, name) for name in _PLAIN}
    for name, estimate in cell.estimates.items():
        row |= {
            name: estimate.mean,
            f"{name}_low": estimate.low,
            f"{name}_high": estimate.high,
            f"{name}_runs": estimate.runs,
        }
    return row


def _row(run: FinishedRun) -> dict[str, Any]:
    return {
        "family": run.spec.family,
        "method": run.spec.method,
        "seed": run.spec.seed,
        "digest": run.digest,
        "spec_digest": run.spec.digest,
        "metrics": {phase: metrics.model_dump() for phase, metrics in run.metrics.items()},
        "wall_s": run.wall_s,
        "cpu_s": run.cpu_s,
        "versions": dict(run.versions),
    }
