"""Writes the report down."""

from pathlib import Path

from risk_sac.report.comparison import Comparison
from risk_sac.report.data import table_csv, table_json
from risk_sac.report.figures import FORMATS, figure_files, figure_names
from risk_sac.report.markdown import table_markdown

FIGURES = "figures"


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
        _replace(folder / name, content)


def _replace(file: Path, content: bytes) -> None:
    """In one step: whoever reads sees the old or the new file."""
    temporary = file.with_name(f".{file.name}.tmp")
    temporary.write_bytes(content)
    temporary.replace(file)
