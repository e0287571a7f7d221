"""Bodies of a campaign's report. `Table` describes what `risk_sac.report` writes, field by field."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from risk_sac.config import CampaignSpec, FamilyName, MethodName
from risk_sac.metrics import METRICS
from risk_sac.records import Phase
from service.schemas.base import Body, Real
from service.schemas.campaigns import Metrics

MetricName = Annotated[
    str,
    Field(
        description=f"{' | '.join(metric.name for metric in METRICS)}; the markdown table defines them.",
        examples=[METRICS[0].name],
    ),
]


class MissingRun(Body):
    """A run that the tables lack."""

    family: FamilyName
    method: MethodName
    seed: int
    reason: Annotated[str, Field(examples=["queued", "failed: worker was killed by SIGKILL"])]
    """Its state, and why it failed."""


class Estimate(Body):
    """A mean over seeds."""

    mean: Real
    """Null where no run has a value."""
    low: Real
    """95 % interval: bootstrap over seeds, Wilson for the rate of one run; null where it takes more runs."""
    high: Real
    runs: int
    """Over how many the mean was taken."""


class Cell(Body):
    """What a method achieved in a family and phase, over all its finished runs."""

    family: FamilyName
    method: MethodName
    phase: Phase
    seeds: list[int]
    """Of the runs that are counted."""
    episodes: int
    rejected: int
    """Infeasible scenes."""
    raw_collisions: int
    """Episodes in which the ego touched something."""
    failures: int
    """Valid collisions."""
    distinct_failures: int
    """Sum over the runs; what two runs found alike counts twice."""
    preventable: int
    """Valid collisions that the careful driver would have prevented, repetitions included."""
    distinct_preventable: int
    """The distinct ones among them: the last step of the funnel contacts → valid → distinct → preventable."""
    artefacts: int
    unresponsive: int
    environment_steps: int
    estimates: Mapping[MetricName, Estimate]
    """By the name of the metric."""
    steps_per_distinct_failure: Real
    cpu_s_per_distinct_failure: Real
    """Processor seconds of the whole runs; of the search only."""
    raw_rate: float
    """Contacts / episodes."""
    artefact_rate: float
    """Contacts that the simulator or the control made / episodes."""
    degenerate_rate: float
    """Contacts that are no valid failure / episodes."""
    rejected_rate: float
    """Infeasible scenes / episodes."""
    unresponsive_share: Real
    """Share of the valid collisions with a visible collision course of 1.5 s or more during which the ego never braked;
    null without one."""
    signatures: Mapping[str, int]
    """Signature → valid collisions."""
    conflicts_by_second: list[int]
    """Valid collisions by the second after the adversaries' release in which the conflict began."""
    contacts_by_second: list[int]
    """The same by the second of the contact."""


class PairedTest(Body):
    """The reference against another method in one metric, runs paired by seed."""

    family: FamilyName
    phase: Phase
    metric: MetricName
    reference: MethodName
    method: MethodName
    pairs: int
    """Seeds for which both have a value."""
    difference: Real
    """Mean of reference - method; null without a pair."""
    low: Real
    """95 % interval of the difference, bootstrapped over the pairs; null with fewer than two."""
    high: Real
    p: Real
    """Wilcoxon signed-rank, exact, two-sided; null with fewer than two pairs."""
    p_holm: Real
    """Corrected over all tests of the same family and phase."""
    a12: Real
    """Vargha-Delaney: chance that the reference's value is the larger one."""


class ReportedRun(Body):
    """One finished run."""

    family: FamilyName
    method: MethodName
    seed: int
    digest: str
    """SHA-256 of the results: the same whenever the run is repeated."""
    spec_digest: str
    metrics: Mapping[Phase, Metrics]
    wall_s: float
    cpu_s: float
    versions: Mapping[str, str]


class Table(Body):
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
    runs: list[ReportedRun]


class FigureFile(Body):
    """A figure in one format."""

    format: Literal["png", "svg"]
    media_type: Annotated[str, Field(examples=["image/svg+xml"])]
    href: Annotated[str, Field(examples=["/v1/campaigns/ca39e56a9cd896b07/figures/ecr_low.svg"])]
    """Where it is."""


class Figure(Body):
    """A figure of the report."""

    name: Annotated[str, Field(examples=["ecr_low", "bars_rho_c_evaluation"])]
    """With a family: `ecr_`, `pcr_`, `lambda_` and `alpha_`, curves over the search; `times_`, histograms of the time
    from the adversaries' release to conflict and contact. `bars_` with a metric: all families."""
    files: list[FigureFile]


class Figures(Body):
    """The figures that the finished runs allow."""

    complete: bool
    """Whether all runs are in them."""
    items: list[Figure]
    """None before a run has finished."""
