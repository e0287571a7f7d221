"""Reads a campaign's runs; writes their comparison as JSON, CSV, Markdown, figures."""

import contextlib
import csv
import hashlib
import html
import io
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from risk_sac.config import IID_METHODS, CampaignSpec, FamilyName, Iid, MethodName, RunSpec
from risk_sac.config.spec_file import read_campaign
from risk_sac.errors import ConfigError
from risk_sac.failures.studied import Studied
from risk_sac.metrics import METRICS
from risk_sac.records import DrivenBy, Fault, Phase, Record, RunMetrics, Severity
from risk_sac.records.assessment import InputDigest, SignedInputs
from risk_sac.report.comparison import Cell, Comparison, MissingRun, compare
from risk_sac.report.figures import FORMATS, figure_files, figure_names
from risk_sac.report.rendering import table_markdown, this_platform
from risk_sac.report.runs import FailureOrigin, FinishedRun, Overview, read_run
from risk_sac.report.statistics import MEASURED, PairedTest
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import EPISODES, FAILURES, RESULTS, VERIFIED, RunResults, read_results
from risk_sac.scenario.families import family_named, sources_named

FIGURES = "figures"
FORMAT_VERSION = 1
_PLAIN = tuple(
    name for name, each in Cell.model_fields.items() if each.annotation in (int, int | None, float, float | None)
)  # a column each


class ReportedRun(Record):
    """One finished run."""

    family: FamilyName
    method: MethodName
    seed: int
    digest: str
    """SHA-256 of the results: the same whenever the run is repeated."""
    spec_digest: str
    metrics: Mapping[Phase, RunMetrics]
    wall_s: float
    cpu_s: float
    versions: Mapping[str, str]


class Table(Record):
    """The comparison of a campaign's methods over seeds; `table.json` of `risk-sac evaluate`."""

    format_version: int
    command: Annotated[
        str,
        Field(
            examples=[
                "curl -s http://127.0.0.1:8000/v1/campaigns/ca39e56a9cd896b07/spec"
                " | curl http://127.0.0.1:8000/v1/campaigns -H 'content-type: application/json' -d @-"
            ]
        ),
    ]
    """What to type to have the same campaign run again."""
    spec_digest: str
    spec: CampaignSpec
    versions: Annotated[Mapping[str, str], Field(examples=[{"libsumo": "1.28.0", "torch": "2.10.0"}])]
    """Software that produced the runs; all versions where runs differ."""
    platform: Mapping[str, str]
    """Machine, processor and Python of the server."""
    complete: bool
    """Whether all runs are in the tables."""
    missing: list[MissingRun]
    reference: MethodName
    """The method that the others are compared with: risk-sac, or the first where it does not take part."""
    cells: list[Cell]
    """By family, phase and method, the reference first; none before a run has finished."""
    tests: list[PairedTest]
    headline: int | None  # each kind once over all searches
    headline_published: int | None
    """Of these kinds, those that R157, FSM or RSS prevents."""
    paid_tests: list[PairedTest]
    """Headline failures within 30 processor seconds; declared beforehand, so corrected by themselves."""
    origins: list[FailureOrigin]
    """Where failures begin, of scenarios that some method plays as they are written: in the grid, where parameters are
    searched, or only where others deviate."""
    failures: Mapping[FamilyName, Overview]
    """The kinds of failures that all methods have found together."""
    studies: Mapping[FamilyName, Mapping[str, Studied]]
    """By family and id, the cores and the regions of failures that were asked for in the runs' folders."""
    runs: list[ReportedRun]


def write_report(comparison: Comparison, folder: Path) -> None:
    """Replace `table.json`, `table.md`, `table.csv` and `figures/` in a folder."""
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


def table_of(comparison: Comparison) -> Table:
    """Builds the content of `table.json`."""
    return Table(
        format_version=FORMAT_VERSION,
        command=comparison.command,
        spec_digest=comparison.spec.digest,
        spec=comparison.spec,
        versions=comparison.versions,
        platform=this_platform(),
        complete=not comparison.missing,
        missing=list(comparison.missing),
        reference=comparison.reference,
        cells=list(comparison.cells),
        tests=list(comparison.tests),
        origins=list(comparison.origins),
        headline=comparison.headline,
        headline_published=comparison.headline_published,
        paid_tests=list(comparison.paid_tests),
        failures=comparison.overviews,
        studies={family: comparison.studies(family) for family in comparison.overviews},
        runs=[
            ReportedRun(
                **{name: getattr(run.spec, name) for name in ("family", "method", "seed")},
                **{name: getattr(run, name) for name in ("digest", "metrics", "wall_s", "cpu_s", "versions")},
                spec_digest=run.spec.digest,
            )
            for run in comparison.runs
        ],
    )


def table_json(comparison: Comparison) -> str:
    """`table.json`."""
    content = table_of(comparison).model_dump(mode="json")
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def table_csv(comparison: Comparison) -> str:
    """`table.csv`; empty where there is no value."""
    text = io.StringIO()
    names = list(dict.fromkeys(("family", "method", "phase", "runs", "headline", "headline_published", *_PLAIN)))
    names += dict.fromkeys(name for cell in comparison.cells for name in _by_name(cell))
    for metric in METRICS:
        names += [metric.name, f"{metric.name}_low", f"{metric.name}_high", f"{metric.name}_runs"]
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(_cell_row(cell) for cell in comparison.cells)
    return text.getvalue()


def _by_name(cell: Cell) -> dict[str, Any]:
    """Columns per severity, fault, driver, and figure of reference drivers and requirements."""
    columns: dict[str, Any] = {f"severity.{each}": cell.by_severity.get(each, 0) for each in Severity}
    for name in ("episodes_driven_by", "headline_driven_by"):
        columns |= {f"{name}.{each}": getattr(cell, name).get(each, 0) for each in DrivenBy}
    columns |= {f"fault.{each}": cell.by_fault.get(each, 0) for each in Fault}
    figures = {**cell.pcr_by_driver, **cell.requirements}.items()
    return columns | {f"{name}.{figure}": value for name, found in figures for figure, value in found}


def _cell_row(cell: Cell) -> dict[str, Any]:
    row: dict[str, Any] = {"family": cell.family, "method": cell.method, "phase": cell.phase, "runs": len(cell.seeds)}
    row |= {name: getattr(cell, name) for name in _PLAIN} | _by_name(cell)
    for name, estimate in cell.estimates.items():
        row |= {
            name: estimate.mean,
            f"{name}_low": estimate.low,
            f"{name}_high": estimate.high,
            f"{name}_runs": estimate.runs,
        }
    return row


SPEC, RUNS = "spec.yaml", "runs"
SHARED = ("ego", "odd", "requirements", "learner", "judge")
AGAIN = "risk-sac evaluate --spec spec.yaml --out campaign"  # with the spec that the report ends with


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """Runs of one campaign, and their folders."""

    comparison: Comparison
    folders: Mapping[str, Path]  # by digest of the run's spec


def read_folders(paths: Sequence[Path]) -> Inputs:
    """Reads runs, and says why unfinished, absent or damaged ones are missing.

    The paths are one folder of `risk-sac evaluate`, or runs that share all but family, method, seed and budget.

    Raises:
      ConfigError: there is no run, or they are of different campaigns.
    """
    campaign, results = campaign_in(paths)
    specs = {path: each.spec for path, each in results.items()}
    runs: list[FinishedRun] = []
    reasons: dict[str, str] = {}
    for path, spec in specs.items():
        try:
            family_named(spec.family)  # whose place on a map may be gone
            runs.append(read_run(path))
        except (ConfigError, OSError) as error:
            reasons[spec.digest] = str(error)
    return Inputs(
        comparison=compare(campaign, runs, AGAIN, reasons=reasons),
        folders={spec.digest: path for path, spec in specs.items()},
    )


def run_folders(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Lists the folders of the runs that a report is made from."""
    whole = paths[0] if len(paths) == 1 and (paths[0] / SPEC).is_file() else None
    return tuple(paths) if whole is None else tuple(sorted((whole / RUNS).glob("*/")))


def campaign_in(paths: Sequence[Path]) -> tuple[CampaignSpec, Mapping[Path, RunResults]]:
    """Reads the campaign of folders, and its results by folder; see `read_folders`."""
    whole = paths[0] if len(paths) == 1 and (paths[0] / SPEC).is_file() else None
    if whole is None:
        results = {path: read_results(path) for path in paths}
    else:  # a damaged results.json does not tell which run it was of; that run is missing
        results = dict(_readable(sorted((whole / RUNS).glob("*/"))))
    if not results:
        raise ConfigError("RUNS", f"there is no run in {paths[0]}")
    if whole is not None:
        return read_campaign(whole / SPEC, {}, {}), results
    return _campaign([each.spec for each in results.values()]), results


def _readable(paths: Iterable[Path]) -> Iterator[tuple[Path, RunResults]]:
    for path in paths:
        with contextlib.suppress(ConfigError):
            yield path, read_results(path)


def _campaign(runs: Sequence[RunSpec]) -> CampaignSpec:
    """The campaign that runs with these specs may be of."""
    searches, drawn = [run for run in runs if not run.iid], [run for run in runs if run.iid]
    if not searches:
        raise ConfigError("RUNS", "only runs of an i.i.d. phase", "one of a search, too")
    for alike, names in ((runs, SHARED), (searches, ("budget",)), (drawn, ("budget", "seed"))):
        for name in names:
            other = next((run for run in alike if getattr(run, name) != getattr(alike[0], name)), None)
            if other is not None:
                raise ConfigError(
                    "RUNS", f"{alike[0].id} and {other.id}, which differ in their {name}", "runs of one campaign"
                )
    first = searches[0]
    return CampaignSpec(
        families=tuple(dict.fromkeys(run.family for run in runs)),
        methods=tuple(dict.fromkeys(run.method for run in searches if run.method not in IID_METHODS)),
        seeds=tuple(sorted({run.seed for run in searches})),
        budget=first.budget,
        iid=Iid(episodes=drawn[0].budget.episodes, seed=drawn[0].seed) if drawn else None,
        **{name: getattr(first, name) for name in SHARED},
    )


FILES = (RESULTS, EPISODES, VERIFIED)
FOLDERS = (FAILURES, "studies")  # one line for all files of each
_LINE = re.compile(r"^([0-9a-f]{64})  (\S+)$", re.MULTILINE)
_TAG = re.compile(r"<[^>]*>")


def signed(digests: Mapping[str, str]) -> SignedInputs:
    """Signs inputs: name → SHA-256."""
    inputs = tuple(InputDigest(name=name, sha256=digests[name]) for name in sorted(digests))
    return SignedInputs(digest=sha256(manifest(inputs).encode()), inputs=inputs)


def manifest(inputs: Iterable[InputDigest]) -> str:
    """Writes the lines that a digest is formed over."""
    return "".join(f"{one.sha256}  {one.name}\n" for one in inputs)


def sha256(content: bytes) -> str:
    """Returns the SHA-256 of some bytes in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def input_digests(
    spec: CampaignSpec, folders: Iterable[Path], *, code: str = "", regression: str = ""
) -> Mapping[str, str]:
    """Digests the inputs of a report: name → SHA-256.

    Files that are not there have no line, nor have an empty `code`, SHA-256 over the sources, and `regression`, JSON.
    """
    digests = {"campaign": spec.digest, "benchmark": sha256(MEASURED.read_bytes())}
    digests |= {"code": code} if code else {}
    digests |= {"regression": sha256(regression.encode())} if regression else {}
    for name in spec.families:
        try:
            digests |= {f"scenarios/{name}/{file}": sha256(content) for file, content in sources_named(name).items()}
        except (ConfigError, OSError):
            continue  # a lost scenario is named in the report
    for folder in folders:
        digests |= dict(_of_run(folder))
    return digests


def _of_run(folder: Path) -> Iterator[tuple[str, str]]:
    for name in FILES:
        if (folder / name).is_file():
            yield f"{folder.name}/{name}", sha256((folder / name).read_bytes())
    for name in FOLDERS:
        files = sorted(path for path in (folder / name).glob("**/*") if path.is_file())
        if files:
            lines = [f"{sha256(path.read_bytes())}  {path.relative_to(folder)}\n" for path in files]
            yield f"{folder.name}/{name}/", sha256("".join(lines).encode())


def inputs_in(text: str) -> SignedInputs:
    """Reads the manifest of a report: JSON, HTML or Markdown.

    Raises:
      ConfigError: the text has no manifest, or its lines are not those that the report's digest was formed over.
    """
    wanted: SignedInputs | None = None
    if text.lstrip().startswith("{"):
        with contextlib.suppress(ValueError):  # no JSON, or no report's: a ValidationError is one, too
            wanted = SignedInputs.model_validate(json.loads(text).get("signed"))
    else:
        if text.lstrip().startswith("<!doctype"):
            text = html.unescape(_TAG.sub("", text))
        lines = {name: digest for digest, name in _LINE.findall(text)}
        stated = re.search(r"digest of all inputs\W*([0-9a-f]{64})", text)
        if lines and stated:
            made = signed(lines)
            wanted = made.model_copy(update={"digest": stated[1]})
    if wanted is None:
        raise ConfigError("REPORT", "a file without the inputs of a report", "a report of `risk-sac report`")
    if signed({one.name: one.sha256 for one in wanted.inputs}).digest != wanted.digest:
        raise ConfigError("REPORT", "a digest that its own list of inputs does not give", "an unchanged report")
    return wanted


def changes(report: SignedInputs, now: SignedInputs) -> Sequence[str]:
    """Names inputs changed, missing or new since a report; empty if none."""
    before, after = ({one.name: one.sha256 for one in inputs.inputs} for inputs in (report, now))
    words = []
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            words.append(f"{name} ({'new' if name not in before else 'missing' if name not in after else 'changed'})")
    return words
