"""Reports, figures and evidence from the folders of finished runs."""

import hashlib
import shlex
import threading
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from risk_sac import __version__
from risk_sac.config import FamilyName
from risk_sac.env.problem import requirements_of
from risk_sac.errors import ConfigError
from risk_sac.failures import studied
from risk_sac.failures.bundle import code_digest
from risk_sac.failures.studied import Regression
from risk_sac.rates.record import METHOD, rates_of
from risk_sac.records import Record, State, TriageState, wire
from risk_sac.records.assessment import CoverageMatrix
from risk_sac.records.rates import Rates
from risk_sac.report import (
    Comparison,
    FinishedRun,
    compare,
    figure_bytes,
    figure_names,
    read_run,
    table_csv,
    table_json,
    table_markdown,
)
from risk_sac.report.document import CARD_TIMES, CampaignFacts, Origin, gathered, report_page
from risk_sac.report.figures import FORMATS, Format
from risk_sac.report.matrix import coverage_matrix
from risk_sac.report.runs import Overview
from risk_sac.report.trend import EndedCampaign, EndedRun, LeftOut, Trend, check_scenarios, driver_name, trend
from risk_sac.run_folder.results import read_boundary_map, read_rates
from risk_sac.scenario.families import family_named
from service.errors import NotFoundError, OutdatedError
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign, StoredRun


@dataclass(frozen=True)
class CampaignReport:
    """One edition of a campaign's report."""

    campaign_id: str
    comparison: Comparison
    """Its content, without commands."""
    folders: Mapping[str, Path]
    """Of the runs, by the digest of their specs."""
    lasting: bool
    """Whether it may be kept: not if a finished run's folder could not be read."""
    _drawn: dict[tuple[str, Format], bytes] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures there are."""
        return figure_names(self.comparison)

    def figure(self, name: str, format_: Format) -> bytes:
        """Returns a figure's file, drawn once; raises NotFoundError if unknown."""
        if name not in self.figures:
            raise unknown_figure(self.campaign_id, name)
        with self._lock:  # a second request for a figure waits for the first
            if (name, format_) not in self._drawn:
                self._drawn[name, format_] = figure_bytes(self.comparison, name, format_)
            return self._drawn[name, format_]


MATRICES_KEPT = 64  # each of some 200 kB


class Reports:
    """Makes reports, and caches the newest and the newest coverage matrices."""

    def __init__(self, settings: ServiceSettings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._newest: tuple[str, CampaignReport] | None = None
        self._matrices: OrderedDict[str, CoverageMatrix] = OrderedDict()

    def edition(self, campaign: StoredCampaign) -> str:
        """A name that changes whenever the report would."""
        lines = [__version__, campaign.id]
        for run in campaign.runs:
            lines.append(f"{run.id} {run.digest or _missing(run)}")
            if run.digest:
                lines.append(studied.edition(self._settings.run_folder(campaign.id, run.id)))
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:32]

    def report(self, campaign: StoredCampaign) -> CampaignReport:
        """Returns a campaign's current report; blocks for seconds of statistics."""
        name = self.edition(campaign)
        with self._lock:
            if self._newest is None or self._newest[0] != name:
                report = self._make(campaign)
                self._newest = (name, report) if report.lasting else None
                return report
            return self._newest[1]

    def matrix(self, campaign: StoredCampaign) -> tuple[CoverageMatrix, bool]:
        """Returns the coverage of finished runs, and whether it may be kept."""
        edition = self.edition(campaign)
        if (made := self._matrices.get(edition)) is not None:
            return made, True
        report = self.report(campaign)
        matrix = coverage_matrix(report.comparison, campaign.id)
        if report.lasting:
            with self._lock:
                self._matrices[edition] = matrix
                if len(self._matrices) > MATRICES_KEPT:
                    self._matrices.popitem(last=False)
        return matrix, report.lasting

    def _make(self, campaign: StoredCampaign) -> CampaignReport:
        finished_runs: list[FinishedRun] = []
        reasons: dict[str, str] = {}
        lasting = True
        for run in campaign.runs:
            if run.state is not State.SUCCEEDED:
                reasons[run.spec_digest] = _missing(run)
                continue
            try:
                family_named(run.family)  # raises where its place on a map is gone
                finished_runs.append(read_run(self._settings.run_folder(campaign.id, run.id)))
            except (ConfigError, OSError) as error:
                problem = error.got if isinstance(error, ConfigError) else error
                reasons[run.spec_digest] = f"it succeeded, but its results are lost: {problem}"
                lasting = False
        comparison = compare(campaign.spec, finished_runs, command="", reasons=reasons)
        folders = {run.spec_digest: self._settings.run_folder(campaign.id, run.id) for run in campaign.runs}
        return CampaignReport(campaign.id, comparison, folders, lasting)


def unknown_figure(campaign_id: str, name: str) -> NotFoundError:
    """The error of a figure that a report does not have."""
    message = f"campaign {campaign_id} has no figure {name!r}; GET its `figures` lists those there are"
    return NotFoundError(message, field="name", got=name)


def _missing(run: StoredRun) -> str:
    return f"{run.state}: {run.reason}" if run.reason else run.state


MEDIA_TYPES = {
    "json": "application/json",
    "html": "text/html",
    "md": "text/markdown",
    "csv": "text/csv",
    "yaml": "application/yaml",
    "xml": "application/xml",
    "png": "image/png",
    "svg": "image/svg+xml",
}
TABLES: dict[str, Callable[[Comparison], str]] = {"json": table_json, "md": table_markdown, "csv": table_csv}


class Clusters(Record):
    """Failures of the finished runs by kind, without flaky ones."""

    complete: bool
    """Whether all runs are in them."""
    families: Mapping[FamilyName, Overview]
    """Those with a finished run."""


class FigureFile(Record):
    """A figure in one format."""

    format: Literal["png", "svg"]
    media_type: Annotated[str, Field(examples=["image/svg+xml"])]
    href: Annotated[str, Field(examples=["/v1/campaigns/ca39e56a9cd896b07/figures/ecr_low.svg"])]
    """Path of the file."""


class Figure(Record):
    """A figure of the report."""

    name: Annotated[str, Field(examples=["ecr_low", "bars_rho_c_evaluation"])]
    """`ecr_`, `pcr_`, `lambda_`, `alpha_`: curves over a family's search; `preventable_found_`, `distinct_found_`: what
    was found over processor time; `times_`: from release to conflict and contact. `bars_`: a metric of all families."""
    files: list[FigureFile]


class Figures(Record):
    """The figures that the finished runs allow."""

    complete: bool
    """Whether all runs are in them."""
    items: list[Figure]
    """None before a run has finished."""


def clusters(made: CampaignReport) -> str:
    """Returns the kinds of failures as JSON."""
    body = Clusters(complete=not made.comparison.missing, families=made.comparison.overviews)
    return body.model_dump_json()


class CampaignRates(Record):
    """Failure rates of a campaign's finished runs of the method `rate`."""

    complete: bool
    """Whether all runs are in them."""
    items: list[Rates]


def rates(made: CampaignReport, scenes_per_hour: float | None) -> bytes:
    """Returns failure rates as JSON; empty without runs of method `rate`."""
    runs = [run for run in made.comparison.runs if run.spec.method == METHOD]
    items = [rates_of(run.spec, run.records, scenes_per_hour) for run in runs]
    return wire(CampaignRates(complete=not made.comparison.missing, items=items))


def table(made: CampaignReport, format_: str, base_url: str) -> str:
    """Returns the comparison in a format of `TABLES`."""
    return TABLES[format_](_with_commands(made, base_url))


def figures(made: CampaignReport, root_path: str) -> str:
    """Returns the figures' paths as JSON, each with the proxy's prefix."""
    items = [
        Figure(name=name, files=_files(f"{root_path}/v1/campaigns/{made.campaign_id}/figures/{name}"))
        for name in made.figures
    ]
    return Figures(complete=not made.comparison.missing, items=items).model_dump_json()


def drawn(made: CampaignReport, format_: Format) -> bytes:
    """Returns a zip of all figures in a format."""
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as files:
        for name in made.figures:
            files.writestr(name, made.figure(name, format_))
    return packed.getvalue()


def evidence(
    made: CampaignReport, format_: str, base_url: str, regression: Regression | None, people: Mapping[TriageState, int]
) -> str:
    """Returns the evidence as JSON, or as page or Markdown with pictures."""
    comparison = _with_commands(made, base_url)
    facts = CampaignFacts(
        id=made.campaign_id,
        folders=tuple(made.folders.values()),
        requirements=requirements_of(comparison.spec),
        code=code_digest(),
        regression=regression,
        people=people,
    )
    campaign_evidence = gathered(comparison, facts)
    if format_ == "json":
        return campaign_evidence.model_dump_json()
    here = f"{base_url}v1/campaigns/{made.campaign_id}"

    def show(run: FinishedRun, failure: str) -> str:
        return shlex.join(["curl", "-s", f"{here}/failures/{failure}/picture.png", "-o", "failure.png"])

    posted = f'{{"campaign_id": "{made.campaign_id}", "ego": {{"profile": "careful"}}}}'
    data = shlex.join(["curl", "-s", f"{here}/report?format=json", "-o", "report.json"])
    origin = Origin(
        report=shlex.join(["curl", "-s", f"{here}/report?format={format_}", "-o", f"report.{format_}"]),
        data=data,
        show=show,
        regress=shlex.join(["curl", f"{base_url}v1/regressions", "-H", "content-type: application/json", "-d", posted]),
        record=lambda run, record: (
            shlex.join(["curl", "-s", f"{here}/failures/{record.id_in(run.spec.id)}"])
            + f" | jq 'del(.series), ({CARD_TIMES})'"
        ),
        verify=f"{data} && jq -r .signed.digest report.json",
        folders=made.folders,
        regression=regression,
    )
    power = campaign_evidence.power
    return report_page(comparison, campaign_evidence, origin, power, "html" if format_ == "html" else "markdown")


def _files(path: str) -> list[FigureFile]:
    return [FigureFile(format=each, media_type=MEDIA_TYPES[each], href=f"{path}.{each}") for each in FORMATS]


def _with_commands(made: CampaignReport, base_url: str) -> Comparison:
    campaigns = f"{base_url}v1/campaigns"
    spec, post, as_yaml = map(
        shlex.quote,
        (f"{campaigns}/{made.campaign_id}/spec", campaigns, f"{campaigns}/{made.campaign_id}/spec?format=yaml"),
    )
    again = f"curl -s {spec} | curl {post} -H 'content-type: application/json' -d @-"
    return replace(made.comparison, command=again, spec_command=f"curl -s {as_yaml} -o spec.yaml")


MOST_CAMPAIGNS = 200  # of an ego; older ones are not read


def trend_of(store: Store, settings: ServiceSettings, name: str, chosen: Sequence[str], project: str | None) -> Trend:
    """Compares versions of an ego, by its newest or the chosen campaigns.

    Raises:
      ConfigError: the chosen campaigns are of another ego, or of different scenarios.
      NotFoundError: there is no such campaign.
    """
    if chosen:
        stored = sorted((store.campaign(id_, project) for id_ in set(chosen)), key=lambda campaign: campaign.number)
    else:
        stored = store.campaigns_of_ego(name, project, MOST_CAMPAIGNS)
    ended: list[EndedCampaign] = []
    left_out: list[LeftOut] = []
    for campaign in stored:
        try:
            read = _ended(campaign, settings)
        except OutdatedError as error:
            left_out.append(LeftOut(campaign_id=campaign.id, reason=str(error)))
            continue
        if driver_name(read.spec.ego) != name:
            raise ConfigError("campaign", f"{read.id}, of the ego {driver_name(read.spec.ego)!r}", f"one of {name!r}")
        if campaign.state is State.SUCCEEDED:
            ended.append(read)
        else:
            left_out.append(LeftOut(campaign_id=campaign.id, reason=f"it is {campaign.state}"))
    if chosen:
        check_scenarios(ended)
    return trend(ended, left_out)


def _ended(campaign: StoredCampaign, settings: ServiceSettings) -> EndedCampaign:
    runs = (
        EndedRun(
            family=run.family,
            method=run.method,
            iid=run.iid,
            phases=tuple(phase for phase in (run.metrics, run.evaluation) if phase is not None),
            versions=run.versions,
            boundary=read_boundary_map(settings.run_folder(campaign.id, run.id)) if run.method == "boundary" else None,
            rates=read_rates(settings.run_folder(campaign.id, run.id)) if run.method == "rate" else None,
        )
        for run in campaign.runs
    )
    return EndedCampaign(id=campaign.id, spec=campaign.spec, runs=tuple(runs), at=campaign.created_at)
