"""Views of all episodes of a campaign; large ones in helpers.

`python -m service.views.whole QUESTION ANSWER` answers one question. It shares the server's database and folders.
"""

import logging
import sys
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Literal, cast

from pydantic import TypeAdapter
from pydantic_core import from_json, to_json
from starlette.concurrency import run_in_threadpool

from risk_sac.config import CampaignSpec, method_of
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.execution.helper import ANSWER, QUESTION
from risk_sac.execution.messages import without_folders
from risk_sac.failures.studied import Regression
from risk_sac.records import Outcome, TriageState, wire
from risk_sac.report.figures import Format
from risk_sac.report.grid import PlayedGrid, Standard, grid_csv, grid_junit, played_points, varied_axes
from risk_sac.search.prior.earlier import SHIPPED_OR_NONE, PriorContent, is_kept
from service.errors import NotFoundError, StorageError
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign, StoredRecord, StoredRun
from service.views import reports
from service.views.curves import curves, scene_effects
from service.views.failure_table import failure_table
from service.views.on_demand import Helper, OnDemandCache
from service.views.reports import CampaignReport, Reports, unknown_figure

GridFormat = Literal["json", "csv", "xml", "png"]


def run_of(campaign: StoredCampaign, run_id: str) -> StoredRun:
    """The run of a campaign with this id; raises `NotFoundError` without one."""
    run = next((run for run in campaign.runs if run.id == run_id), None)
    if run is None:
        message = f"campaign {campaign.id} has no run {run_id!r}; GET it lists all runs"
        raise NotFoundError(message, field="run_id", got=run_id)
    return run


def played_grid(
    campaign: StoredCampaign, run_id: str, episodes: Iterable[StoredRecord], standard: Standard
) -> PlayedGrid:
    """The scenes of a run so far.

    Args:
      campaign: of the run.
      run_id: of the run.
      episodes: of all runs, in order.
      standard: the driver that tells a failure from a scene that is out of scope.

    Raises:
      NotFoundError: the campaign has no such run, or its method plays no scenario as it is written.
    """
    run = run_of(campaign, run_id)
    spec = next(spec for spec in campaign.spec.runs() if spec.id == run_id)
    if not method_of(spec.method).story:
        message = f"run {run_id} is of the method {spec.method}; wanted one of story-sweep, story-random or story-bo"
        raise NotFoundError(message, field="run_id", got=run_id)
    records = [episode.record for episode in episodes if episode.run_number == run.number]
    return PlayedGrid(spec=spec, standard=standard, points=played_points(spec, records, standard))


def written_grid(grid: PlayedGrid, format_: GridFormat, over: Sequence[str]) -> bytes:
    """A played grid as a file.

    `over` names the two parameters of a picture; without it they are the first two that vary.
    """
    if format_ == "csv":
        return grid_csv([grid]).encode()
    if format_ == "xml":
        return grid_junit([grid])
    if format_ == "png":
        from risk_sac.report.parameter_plots import grid_png  # here, because loading matplotlib takes a second

        if len(over) not in (0, 2):
            raise ConfigError("over", ", ".join(over), "two parameters, or none")
        return grid_png([grid], (over[0], over[1]) if over else varied_axes([grid]), {})
    return wire(grid)


logger = logging.getLogger(__name__)

LARGE = 4000  # episodes; reading more in the server would hold up other requests
MEMORY_BYTES, WALL_S = 4 << 30, 1800.0  # of a helper; 100,000 episodes take 2.4 GiB and, where many fail, minutes
VIEWS_KEPT = 4  # of some megabytes each
REFUSED, LOST, PASSING, TOO_LARGE = 3, 4, 5, 6  # exit statuses
ViewName = Literal[
    "curves",
    "scenes",
    "failure_table",
    "table",
    "clusters",
    "figures",
    "drawn",
    "report",
    "coverage",
    "rates",
    "grid",
    "prior",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignView:
    """A view of a campaign, and what it depends on."""

    name: ViewName
    campaign_id: str
    """Of a prior: empty where it names a copy."""
    edition: str
    """Changes whenever the content would."""
    format: str = ""
    address: str = ""
    """Base URL in commands, or the root path of figures."""
    points: int = 0
    outcomes: tuple[Outcome, ...] = ()
    prior: str = ""
    run: str = ""
    standard: Standard = "r157"
    over: tuple[str, ...] = ()
    """Parameters of a grid's picture."""
    regression: Regression | None = None
    scenes_per_hour: float | None = None
    people: tuple[tuple[TriageState, int], ...] = ()
    """Failures by what people made of them."""


@dataclass(frozen=True, slots=True)
class Content:
    """Content of a view; one that does not last is not cached."""

    body: bytes
    lasting: bool = True


@dataclass(frozen=True, slots=True)
class Sources:
    """Sources of views; a copied prior is of no campaign."""

    settings: ServiceSettings
    store: Store
    reports: Reports
    campaign: StoredCampaign | None


def content_of(view: CampaignView, sources: Sources) -> Content:
    """Makes the content of a view; takes seconds for a large campaign."""
    campaign, store = sources.campaign, sources.store
    if view.name == "prior":
        folder = sources.settings.campaign_folder(view.campaign_id) if view.campaign_id else None
        return Content(_PRIOR.dump_json(PriorContent.read(view.prior, folder)))
    assert campaign is not None
    if view.name == "failure_table":
        failures = store.records(campaign.number, view.outcomes)
        return Content(wire(failure_table(campaign, failures, store.triages(campaign.number))))
    if view.name == "curves":
        return Content(wire(curves(campaign, store.records(campaign.number), view.points)))
    if view.name == "scenes":
        return Content(wire(scene_effects(campaign, store.records(campaign.number))))
    if view.name == "grid":
        grid = played_grid(campaign, view.run, store.records(campaign.number), view.standard)
        return Content(written_grid(grid, cast(GridFormat, view.format), view.over))
    if view.name == "coverage":
        matrix, lasting = sources.reports.matrix(campaign)
        return Content(wire(matrix), lasting)
    made = sources.reports.report(campaign)
    return Content(_OF_REPORT[view.name](made, view), made.lasting)


_PRIOR = TypeAdapter(PriorContent)
_OF_REPORT: Mapping[str, Callable[[CampaignReport, CampaignView], bytes]] = {
    "table": lambda made, view: reports.table(made, view.format, view.address).encode(),
    "clusters": lambda made, view: reports.clusters(made).encode(),
    "figures": lambda made, view: reports.figures(made, view.address).encode(),
    "drawn": lambda made, view: reports.drawn(made, cast(Format, view.format)),
    "rates": lambda made, view: reports.rates(made, view.scenes_per_hour),
    "report": lambda made, view: reports.evidence(
        made, view.format, view.address, view.regression, dict(view.people)
    ).encode(),
}


class _Passing(Exception):
    """Content that does not last, so that no cache keeps it."""


class Views(OnDemandCache[CampaignView]):
    """Views of campaigns: small ones made here, large ones in a helper."""

    def __init__(self, settings: ServiceSettings, store: Store, reports: Reports, helper: Helper, kept: int) -> None:
        super().__init__(self._helped, "views of large campaigns", kept)
        self._settings, self._store, self._reports, self._helper = settings, store, reports, helper

    async def content(self, view: CampaignView, campaign: StoredCampaign, key_id: str | None) -> Content:
        """Returns the content of a campaign's view; raises what making raises."""
        if not _large(campaign):
            sources = Sources(self._settings, self._store, self._reports, campaign)
            return await run_in_threadpool(content_of, view, sources)
        try:
            return Content(await self.get(view, key_id))
        except _Passing as content:
            return Content(content.args[0], lasting=False)

    async def figure(self, view: CampaignView, campaign: StoredCampaign, name: str, key_id: str | None) -> Content:
        """Returns one figure of a view; raises NotFoundError if unknown."""
        if not _large(campaign):
            made = await run_in_threadpool(self._reports.report, campaign)
            return Content(await run_in_threadpool(made.figure, name, cast(Format, view.format)), made.lasting)
        content = await self.content(view, campaign, key_id)
        with zipfile.ZipFile(BytesIO(content.body)) as figures:
            if name not in figures.namelist():
                raise unknown_figure(campaign.id, name)
            return Content(figures.read(name), content.lasting)

    def _helped(self, view: CampaignView) -> bytes:
        settings = self._settings
        question = _Question(view=view, data_dir=settings.data_dir, database_url=settings.database_url)
        result = self._helper.run(
            "service.views.whole",
            [QUESTION, ANSWER],
            _QUESTION.dump_json(question),
            wall_s=WALL_S,
            memory_bytes=MEMORY_BYTES,
        )
        if result.status == 0:
            return result.answer
        if result.status == PASSING:
            raise _Passing(result.answer)
        if result.status == REFUSED:
            raise ConfigError(*from_json(result.answer))
        logger.error("%s was not made (status %d): %s", view, result.status, result.log)
        reason = "the log has the reason"
        if result.status == LOST:
            reason = without_folders(result.answer.decode(errors="replace"))
        elif result.status == TOO_LARGE:
            reason = f"it takes more than {MEMORY_BYTES >> 30} GiB"
        elif result.timed_out:
            reason = f"it takes more than {WALL_S:g} s"
        what = f"{view.name.replace('_', ' ')} of {view.campaign_id or view.prior}"
        raise StorageError(f"{what} cannot be made: {reason}; lists of episodes and failures still work")


class Priors:
    """Priors of campaigns, read in a helper, once per earlier campaign."""

    def __init__(self, store: Store, views: Views) -> None:
        self._store, self._views = store, views

    async def of(self, spec: CampaignSpec, project: str, key_id: str | None) -> PriorContent | None:
        """Returns the scripts of a campaign's prior; None if it names none.

        Raises:
          ConfigError: there is no such campaign, it followed no scripts, or is like another family.
        """
        if spec.prior in SHIPPED_OR_NONE:
            return None
        campaign_id = await run_in_threadpool(self._campaign_id, spec.prior, project)
        view = CampaignView(name="prior", campaign_id=campaign_id, edition="", prior=spec.prior)
        found = _PRIOR.validate_json(await self._views.get(view, key_id))
        return found.checked(spec.prior, spec.families)

    def _campaign_id(self, prior: str, project: str) -> str:
        """Returns the id of a prior's ended campaign; empty for a copy."""
        if is_kept(prior):
            return ""
        try:
            campaign = self._store.campaign(prior, project)
        except NotFoundError as error:
            raise ConfigError("prior", f"{prior!r}", "shipped, none, or the id of a campaign") from error
        if not campaign.state.final:
            raise ConfigError("prior", f"{prior}, which is {campaign.state}", "a campaign that has ended")
        return campaign.id


def _large(campaign: StoredCampaign) -> bool:
    return sum(run.episodes_done for run in campaign.runs) > LARGE


@dataclass(frozen=True, slots=True, kw_only=True)
class _Question:
    view: CampaignView
    data_dir: Path
    database_url: str | None


_QUESTION = TypeAdapter(_Question)


def _main(asked: Path, file: Path) -> int:
    question = _QUESTION.validate_json(asked.read_bytes())
    view = question.view
    settings = ServiceSettings(data_dir=question.data_dir, database_url=question.database_url)
    try:
        with closing(Store(settings.url, opened=True)) as store:
            campaign = store.campaign(view.campaign_id) if view.name != "prior" else None
            content = content_of(view, Sources(settings, store, Reports(settings), campaign))
        file.write_bytes(content.body)
    except ConfigError as error:
        file.write_bytes(to_json(error.args))
        return REFUSED
    except RiskSacError as error:
        file.write_text(str(error), encoding="utf-8")
        return LOST
    except MemoryError:
        return TOO_LARGE
    return 0 if content.lasting else PASSING


if __name__ == "__main__":
    sys.exit(_main(*map(Path, sys.argv[1:])))
