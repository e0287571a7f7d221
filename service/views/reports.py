"""Report of a campaign from the folders of its finished runs, as `risk-sac evaluate` makes it."""

import hashlib
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from risk_sac import __version__
from risk_sac.errors import ConfigError
from risk_sac.failures import studied
from risk_sac.records import State
from risk_sac.report import Comparison, FinishedRun, compare, figure_bytes, figure_names, read_run
from risk_sac.report.figures import Format
from risk_sac.scenario.families import family_named
from service.errors import NotFoundError
from service.settings import ServiceSettings
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
        """Returns one figure as a file, drawn once; NotFoundError if there is no such figure."""
        if name not in self.figures:
            raise unknown_figure(self.campaign_id, name)
        with self._lock:  # a second request for a figure waits for the first
            if (name, format_) not in self._drawn:
                self._drawn[name, format_] = figure_bytes(self.comparison, name, format_)
            return self._drawn[name, format_]


class Reports:
    """Makes reports and caches the newest."""

    def __init__(self, settings: ServiceSettings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._newest: tuple[str, CampaignReport] | None = None

    def edition(self, campaign: StoredCampaign) -> str:
        """A name that changes whenever the report would."""
        lines = [__version__, campaign.id]
        for run in campaign.runs:
            lines.append(f"{run.id} {run.digest or _missing(run)}")
            if run.digest:
                lines.append(studied.edition(self._settings.run_folder(campaign.id, run.id)))
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:32]

    def report(self, campaign: StoredCampaign) -> CampaignReport:
        """Returns the current report of a campaign; blocks for seconds while statistics run."""
        name = self.edition(campaign)
        with self._lock:
            if self._newest is None or self._newest[0] != name:
                report = self._make(campaign)
                self._newest = (name, report) if report.lasting else None
                return report
            return self._newest[1]

    def _make(self, campaign: StoredCampaign) -> CampaignReport:
        found: list[FinishedRun] = []
        reasons: dict[str, str] = {}
        lasting = True
        for run in campaign.runs:
            if run.state is not State.SUCCEEDED:
                reasons[run.spec_digest] = _missing(run)
                continue
            try:
                family_named(run.family)  # raises where its place on a map is gone
                found.append(read_run(self._settings.run_folder(campaign.id, run.id)))
            except (ConfigError, OSError) as error:
                problem = error.got if isinstance(error, ConfigError) else error
                reasons[run.spec_digest] = f"it succeeded, but its results are lost: {problem}"
                lasting = False
        comparison = compare(campaign.spec, found, command="", reasons=reasons)
        folders = {run.spec_digest: self._settings.run_folder(campaign.id, run.id) for run in campaign.runs}
        return CampaignReport(campaign.id, comparison, folders, lasting)


def unknown_figure(campaign_id: str, name: str) -> NotFoundError:
    """The error of a figure that a report does not have."""
    message = f"campaign {campaign_id} has no figure {name!r}; GET its `figures` lists those there are"
    return NotFoundError(message, field="name", got=name)


def _missing(run: StoredRun) -> str:
    """Why a run that has not succeeded is not in the tables."""
    return f"{run.state}: {run.reason}" if run.reason else run.state
