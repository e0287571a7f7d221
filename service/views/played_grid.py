"""The standard's verdict on each scene of a run that plays a scenario as it is written."""

from collections.abc import Iterable, Sequence
from typing import Literal

from risk_sac.config import method_of
from risk_sac.errors import ConfigError
from risk_sac.records import wire
from risk_sac.report.grid import PlayedGrid, Standard, grid_csv, played_points, varied_axes
from risk_sac.report.grid_junit import grid_junit
from service.errors import NotFoundError
from service.store.stored import StoredCampaign, StoredRecord, StoredRun

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
    """A played grid as a file; `over` names the two parameters of a picture, the first two that vary without it."""
    if format_ == "csv":
        return grid_csv([grid]).encode()
    if format_ == "xml":
        return grid_junit([grid])
    if format_ == "png":
        from risk_sac.report.grid_picture import grid_png  # here, because loading matplotlib takes a second

        if len(over) not in (0, 2):
            raise ConfigError("over", ", ".join(over), "two parameters, or none")
        return grid_png([grid], (over[0], over[1]) if over else varied_axes([grid]), {})
    return wire(grid)
