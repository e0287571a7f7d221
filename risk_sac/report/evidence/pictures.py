"""A small drawing of a failure, from the time series in its run's folder."""

import zipfile
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.errors import RiskSacError
from risk_sac.failures.recording import Recording
from risk_sac.failures.roads import roads_of
from risk_sac.failures.thumbnail import thumbnail
from risk_sac.report.runs import FinishedRun
from risk_sac.run_folder.results import FAILURES, Contact, series_name


class Drawing(NamedTuple):
    """An SVG, or why there is none."""

    svg: bytes | None
    missing: str = ""


def draw(run: FinishedRun, folder: Path | None, index: int) -> Drawing:
    """The failure of an episode, from above.

    What is lost leaves no hole in a report: it says in the picture's place what is missing.

    Args:
      run: that found it.
      folder: of the run; None where nobody knows it.
      index: of the episode.
    """
    if folder is None:
        return Drawing(None, "the folder of its run is not there")
    record = next(each for each in run.records if each.index == index)
    try:
        with (folder / FAILURES / series_name(index)).open("rb") as file, np.load(file, allow_pickle=False) as archive:
            series = {name: archive[name] for name in archive.files}
        recording = Recording(Contact.of(run.spec.id, record), series)
        return Drawing(thumbnail(recording, roads_of(run.spec.family, record.scene)).encode())
    except RiskSacError as error:  # of a place on a map
        return Drawing(None, str(error))
    except FileNotFoundError as error:
        lost = "its time series" if str(error.filename or "").endswith(".npz") else "the road net"
        return Drawing(None, f"{lost} is gone")
    except OSError as error:
        return Drawing(None, f"it cannot be read: {error.strerror}")
    except (zipfile.BadZipFile, zlib.error, ValueError, EOFError, KeyError, SyntaxError):  # the last: of the net's XML
        return Drawing(None, "its time series or the road net is damaged")
