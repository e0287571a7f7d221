"""Pictures, ground and twins of one failure."""

import hashlib
from dataclasses import asdict, dataclass, field, replace

from risk_sac import __version__
from risk_sac.failures.net import SurfaceUse, roads_of
from risk_sac.failures.question import Twin, read_twin
from risk_sac.failures.recording import Recording
from risk_sac.failures.signals import SignalColour, signal_heads
from risk_sac.failures.thumbnail import thumbnail
from risk_sac.records import Collision, Episode, Record
from risk_sac.run_folder.results import RecordedFailure
from risk_sac.series import Series
from service.settings import ServiceSettings
from service.store.stored import StoredCampaign, StoredFailure, StoredRun
from service.views.on_demand import OnDemandCache
from service.views.series import load_arrays, series_body, series_file

MM = 3  # decimals of a metre


@dataclass(frozen=True, slots=True)
class FailureOfARun:
    """A failure; two with the same edition look the same."""

    edition: str  # changes whenever its pictures would
    campaign: StoredCampaign = field(compare=False)
    run: StoredRun = field(compare=False)
    stored: StoredFailure = field(compare=False)

    @property
    def episode(self) -> Episode:
        """The episode that ended in it."""
        return self.stored.episode

    @classmethod
    def of(cls, campaign: StoredCampaign, stored: StoredFailure) -> "FailureOfARun":
        """A failure of a campaign."""
        episode = stored.episode
        run = next(run for run in campaign.runs if run.id == episode.run_id)
        # The run's digest: what is made of a run that has ended holds its policy too.
        told = (str(run.digest), str(stored.series_sha256), episode.model_dump_json())
        parts = (__version__, campaign.id, episode.id, *told)
        edition = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]
        return cls(edition, campaign, run, stored)


def recording_of(failure: FailureOfARun, settings: ServiceSettings) -> Recording:
    """Returns the recording to draw; SeriesLost if its time series is lost."""
    episode = failure.episode
    path, sha256 = series_file(failure.campaign.id, failure.stored, settings)
    arrays = load_arrays(path, sha256)
    return Recording(RecordedFailure(id=episode.id, series=path.name, episode=episode), arrays)


@dataclass(frozen=True, slots=True)
class Picture:
    """Key of a picture: a failure, and optionally its twin."""

    failure: FailureOfARun
    twin: Twin | None = None
    """What is drawn beside it."""
    played: bytes = field(default=b"", compare=False)
    """That twin as a study told it."""


def pictures(settings: ServiceSettings) -> OnDemandCache[Picture]:
    """PNGs of failures; SeriesLost where the time series is lost."""

    def draw(picture: Picture) -> bytes:
        from risk_sac.failures.show import recording_bytes  # here, because it loads matplotlib

        recording, twin = recording_of(picture.failure, settings), None
        if picture.twin is not None:
            told, series = read_twin(picture.played)
            twin = replace(recording, series=series, twin=told.title)
        return recording_bytes(picture.failure.run.family, recording, "png", twin)

    return OnDemandCache(draw, "pictures")


class Surface(Record):
    """A piece of ground that one drives or walks on."""

    use: SurfaceUse
    outline: list[tuple[float, float]]
    """Its corners, m, on the map that the series is on; the last one is joined to the first."""


class SignalHead(Record):
    """The signal at the end of a lane, or at one end of a crossing."""

    x_m: float
    y_m: float
    heading_rad: float
    """Along the lane."""
    width_m: float
    changes: list[tuple[float, SignalColour]]
    """When it begins to show a colour, s, by the clock of the series."""


class Roads(Record):
    """The ground of a failure, and its signals."""

    surfaces: list[Surface]
    """In the order in which they are to be drawn; none where the scene's family had other roads then."""
    signals: list[SignalHead]


class TwinPlay(Record):
    """The scene of a failure, played with one thing changed."""

    twin: Twin
    """`idle`: no adversary attacks; else the profile of another ego."""
    outcome: str
    """In words."""
    collision: Collision | None
    """Null without a contact."""
    series: Series
    """From the same start as the failure's own, up to 3 s after it, or until a contact."""


def roads_body(failure: FailureOfARun) -> Roads:
    """Returns the surfaces and signals of a failure's scene."""
    place = failure.run.family, failure.episode.scene
    surfaces = [Surface(use=road.use, outline=road.outline.round(MM).tolist()) for road in roads_of(*place)]
    return Roads(surfaces=surfaces, signals=[SignalHead.model_validate(asdict(head)) for head in signal_heads(*place)])


def thumbnail_of(failure: FailureOfARun, settings: ServiceSettings) -> str:
    """Returns a failure as a small SVG; SeriesLost if its time series is lost."""
    place = failure.run.family, failure.episode.scene
    return thumbnail(recording_of(failure, settings), roads_of(*place), signal_heads(*place))


def twin_body(twin: Twin, played: bytes) -> TwinPlay:
    """A twin, as a study played it, with its full time series."""
    told, arrays = read_twin(played)
    return TwinPlay(twin=twin, outcome=told.outcome, collision=told.collision, series=series_body(arrays))
