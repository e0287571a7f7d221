"""Bodies of a campaign's report. `Table` describes what `risk_sac.report` writes, field by field."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from risk_sac.config import CampaignSpec, FamilyName, MethodName
from risk_sac.failures.clusters import Overview
from risk_sac.failures.studied import Studied
from risk_sac.records import Phase, Record, RunMetrics
from risk_sac.report import PairedTest
from risk_sac.report.cells import Cell


class Clusters(Record):
    """The failures of the finished runs, sorted into kinds; flaky ones are left out."""

    complete: bool
    """Whether all runs are in them."""
    families: Mapping[FamilyName, Overview]
    """Those with a finished run."""


class MissingRun(Record):
    """A run that the tables lack."""

    family: FamilyName
    method: MethodName
    seed: int
    reason: Annotated[str, Field(examples=["queued", "failed: worker was killed by SIGKILL"])]
    """Its state, and why it failed."""


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
    headline: list[PairedTest]
    """Of distinct preventable failures within 30 processor seconds: risk-sac-diverse, or the first method, against the
    others; declared before any run, so corrected by themselves."""
    failures: Mapping[FamilyName, Overview]
    """The kinds of failures that all methods have found together."""
    studies: Mapping[FamilyName, Mapping[str, Studied]]
    """By family and id, the cores and the regions of failures that were asked for in the runs' folders."""
    runs: list[ReportedRun]


class FigureFile(Record):
    """A figure in one format."""

    format: Literal["png", "svg"]
    media_type: Annotated[str, Field(examples=["image/svg+xml"])]
    href: Annotated[str, Field(examples=["/v1/campaigns/ca39e56a9cd896b07/figures/ecr_low.svg"])]
    """Where it is."""


class Figure(Record):
    """A figure of the report."""

    name: Annotated[str, Field(examples=["ecr_low", "bars_rho_c_evaluation"])]
    """With a family: `ecr_`, `pcr_`, `lambda_` and `alpha_`, curves over the search; `preventable_found_` and
    `distinct_found_`, what was found over processor time; `times_`, histograms of the time
    from the adversaries' release to conflict and contact. `bars_` with a metric: all families."""
    files: list[FigureFile]


class Figures(Record):
    """The figures that the finished runs allow."""

    complete: bool
    """Whether all runs are in them."""
    items: list[Figure]
    """None before a run has finished."""
