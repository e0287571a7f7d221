"""The runs of one campaign, found in folders."""

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config import IID_METHODS, CampaignSpec, Iid, RunSpec
from risk_sac.config.spec_file import read_campaign
from risk_sac.errors import ConfigError
from risk_sac.report.comparison import Comparison, compare
from risk_sac.report.runs import FinishedRun, read_run
from risk_sac.run_folder.results import RunResults, read_results
from risk_sac.scenario.families import family_named

SPEC, RUNS = "spec.yaml", "runs"
SHARED = ("ego", "odd", "requirements", "learner", "judge")
AGAIN = "risk-sac evaluate --spec spec.yaml --out campaign"  # with the spec that the report ends with


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """Runs of one campaign, and their folders."""

    comparison: Comparison
    folders: Mapping[str, Path]  # by digest of the run's spec


def read_folders(paths: Sequence[Path]) -> Inputs:
    """Reads runs, and says why those are missing that are not finished, not there, or damaged.

    Args:
      paths: one folder of `risk-sac evaluate`, or folders of runs that share all but family, method, seed and budget.

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


def campaign_in(paths: Sequence[Path]) -> tuple[CampaignSpec, Mapping[Path, RunResults]]:
    """Reads the campaign of some folders, and the results of its runs by their folder; arguments as above.

    Raises:
      ConfigError: there is no run, or they are of different campaigns.
    """
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
