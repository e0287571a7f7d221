"""Writes a campaign's report: findings, rates, gaps and doubts."""

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from risk_sac.config import IID_METHODS, CampaignSpec, FamilyName
from risk_sac.config.spec_file import campaign_yaml
from risk_sac.errors import ConfigError, DamagedError, RiskSacError
from risk_sac.failures.cases import Regression
from risk_sac.failures.clusters import Cluster
from risk_sac.failures.net import roads_of, signal_heads
from risk_sac.failures.recording import Recording
from risk_sac.failures.thumbnail import thumbnail
from risk_sac.records import Collision, EpisodeRecord, Power, Violation
from risk_sac.report.comparison import Comparison
from risk_sac.report.evidence import CampaignEvidence
from risk_sac.report.rendering import Layout, render
from risk_sac.report.reported_cases import allowed
from risk_sac.report.runs import FinishedRun
from risk_sac.report.signing import manifest
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, RecordedFailure, series_name
from risk_sac.scenario.families import family_named
from risk_sac.scenario.family import Family
from risk_sac.scenario.odd import field as odd_field
from risk_sac.scenario.odd import intersect, paths
from risk_sac.verdicts import words

MOST_KINDS = 12  # pictured, of a family
# Filter of jq: what a card says of the contact by the difference of two times.
CARD_TIMES = ".collision // empty | {conflict_to_contact_s: (.time_s - .judgement.conflict_s)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Places of the runs and commands to type, known to the caller only."""

    report: str  # the command that makes this report
    data: str  # the command that writes all numbers of the report to report.json
    show: Callable[[FinishedRun, str], str]  # of a run and the id of one of its failures: the command that draws it
    regress: str  # the command that plays the failures against another ego
    verify: str = ""  # the command that forms the digest of all inputs again
    record: Callable[[FinishedRun, EpisodeRecord], str] | None = None  # the command that prints an episode's record
    recount: Callable[[FinishedRun], str] | None = None  # of a run: the command that counts the outcomes on record
    folders: Mapping[str, Path] = field(default_factory=dict)  # by digest of the run's spec
    regression: Regression | None = None  # the campaign's failures against another ego, if played


@dataclass(frozen=True, slots=True)
class Drawing:
    """An SVG, or why there is none."""

    svg: bytes | None
    missing: str = ""


DAMAGED = Drawing(None, "its time series or the road net is damaged")


@dataclass(frozen=True, slots=True)
class FailureGroup:
    """A kind of failure, with the episode to look at first."""

    cluster: Cluster
    run: FinishedRun
    record: EpisodeRecord
    violation: Collision | Violation | None  # of this kind
    command: str  # lines that draw the episode, and print its record
    drawing: Drawing


def report_page(
    comparison: Comparison, evidence: CampaignEvidence, origin: Origin, power: Power, layout: Layout
) -> str:
    """Renders the whole report of the runs that have finished; `power` is that of their budget."""
    families, lost = _families(comparison.spec)
    return render(
        "report",
        layout,
        comparison=comparison,
        spec=comparison.spec,
        evidence=evidence,
        origin=origin,
        power=power,
        families=families,
        lost=lost,
        odd=_odd(comparison.spec, families),
        kinds={name: _kinds(comparison, name, origin) for name in comparison.overviews},
        settings=campaign_yaml(comparison.spec),
        iid_methods=IID_METHODS,
        manifest=manifest,
        words=words,
    )


def show_command(folder: Path, failure: str) -> str:
    """Returns the command that draws a failure of the run in a folder."""
    return shlex.join(["risk-sac", "show", str(folder), failure, "--out", "failure.png"])


def _families(spec: CampaignSpec) -> tuple[Mapping[FamilyName, Family], Mapping[FamilyName, str]]:
    """Returns the families of a campaign, and why the others are lost."""
    there: dict[FamilyName, Family] = {}
    lost: dict[FamilyName, str] = {}
    for name in spec.families:
        try:
            there[name] = family_named(name)
        except ConfigError as error:
            lost[name] = str(error)
    return there, lost


def _odd(spec: CampaignSpec, families: Mapping[FamilyName, Family]) -> Mapping[str, list[str]]:
    """Returns what each family and the campaign allow together, by field of the ODD."""
    odds = [intersect(family.odd, spec.odd) for family in families.values()]
    return {path: [allowed(odd_field(odd, path)) for odd in odds] for path in (paths(odds[0]) if odds else ())}


def _kinds(comparison: Comparison, family: FamilyName, origin: Origin) -> list[FailureGroup]:
    episodes = {
        record.id_in(run.spec.id): (run, record)
        for run in comparison.runs
        if run.spec.family == family
        for record in run.records
        if record.worst_violation is not None
    }
    kinds = []
    for cluster in comparison.overviews[family].clusters[:MOST_KINDS]:
        run, record = episodes[cluster.representative]
        violation = next((one for one in record.valid_violations if one.kind == cluster.name), None)
        commands = [origin.show(run, cluster.representative)]
        if origin.record is not None:
            commands.append(origin.record(run, record))
        drawing = _draw(run, origin.folders.get(run.spec.digest), record)
        kinds.append(FailureGroup(cluster, run, record, violation, "\n".join(commands), drawing))
    return kinds


def _draw(run: FinishedRun, folder: Path | None, record: EpisodeRecord) -> Drawing:
    """Draws a failure from above, or says what is missing; `folder` is its run's."""
    if folder is None:
        return Drawing(None, "the folder of its run is missing")
    try:
        series = read_series(folder / FAILURES / series_name(record.index))
        recording = Recording(RecordedFailure.of(run.spec.id, record), series)
        place = run.spec.family, record.scene
        return Drawing(thumbnail(recording, roads_of(*place), signal_heads(*place)).encode())
    except DamagedError:
        return DAMAGED
    except RiskSacError as error:  # of a place on a map
        return Drawing(None, str(error))
    except FileNotFoundError as error:
        lost = "its time series" if str(error.filename or "").endswith(".npz") else "the road net"
        return Drawing(None, f"{lost} is gone")
    except OSError as error:
        return Drawing(None, f"it cannot be read: {error.strerror}")
    except (ValueError, LookupError):
        return DAMAGED
