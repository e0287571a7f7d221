"""Reads the failures of earlier runs, where an estimate of a failure rate looks first.

They come from a search or from draws: it does not matter how they were found, since no estimate counts them.
"""

from pathlib import Path

from risk_sac.config import FamilyName, RateStart
from risk_sac.errors import ConfigError
from risk_sac.run_folder.results import RESULTS, RunResults, read_results

FIELD = "from"
MOST = 300  # scenes of a start, from the first failure to the last


def start_in(folder: Path, family: FamilyName) -> RateStart:
    """Returns the scenes in which earlier runs of a scenario failed.

    Args:
      folder: of a run, or of a campaign.
      family: the scenario.

    Raises:
      ConfigError: there is no run, or none of this scenario, by these definitions, with a failure.
    """
    from risk_sac.verdicts.judge import DEFINITIONS  # here, because it loads what judges an episode

    files = (folder / RESULTS, *sorted(folder.glob(f"runs/*/{RESULTS}")), *sorted(folder.glob(f"*/{RESULTS}")))
    runs = [read_results(file) for file in files if file.is_file()]
    if not runs:
        raise ConfigError(FIELD, f"{folder}, without {RESULTS}", "the folder of an earlier run or campaign")
    alike = [run for run in runs if run.spec.family == family]
    if not alike:
        others = ", ".join(sorted({run.spec.family for run in runs}))
        raise ConfigError(FIELD, f"{folder}, whose runs are of {others}", f"a run of {family}")
    judged = [run for run in alike if _definitions(run) == str(DEFINITIONS)]
    if not judged:
        versions = ", ".join(sorted({_definitions(run) for run in alike}))
        got = f"{folder}, judged by definitions {versions}"
        raise ConfigError(FIELD, got, f"definitions {DEFINITIONS}", "run it again, and name the new folder")
    scenes = [failure.episode.scene for run in judged for failure in run.failures if failure.episode.valid_violations]
    if not scenes:
        got = f"{folder}, without a failure of {family}"
        raise ConfigError(FIELD, got, "a run that has found some", "leave it out: the estimate needs none")
    return RateStart(scenes=tuple(scenes[:: -(-len(scenes) // MOST)]))


def _definitions(run: RunResults) -> str:
    return (run.versions or {}).get("definitions", "unknown")
