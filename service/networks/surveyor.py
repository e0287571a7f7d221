"""Finds places of a network, or stores some in the library.

`service.networks.surveys` starts `service.networks.surveyor REPORT survey|keep …` in the folder of a checked network,
with limits on time and memory, since a search takes seconds that would block the server.

    survey                 writes `places.json`, `places.png` and `roads.json` beside the net
    keep PATTERN [PLACE]   keeps that place, or all of the pattern, and reports the names of the families that they are
"""

import json
import sys
import time
from pathlib import Path

from risk_sac.errors import ConfigError
from risk_sac.failures.from_above import map_png
from risk_sac.failures.net import surfaces
from risk_sac.maps.finder import FINDERS, Map, survey
from risk_sac.maps.found import Pattern
from risk_sac.run_folder.durable import replace_file, write_sealed
from risk_sac.world.net import Net
from risk_sac.world.read_net import read_net
from service.networks.schemas import (
    MAX_PLACES,
    PICTURE,
    PLACES,
    PROGRESS,
    ROADS,
    SURVEY_MEMORY_BYTES,
    Elsewhere,
    FoundPlace,
    Places,
)

NET = Path("net.xml")
TOLD_EVERY_S = 1.0


def main() -> None:
    """Do what the arguments say, and say what came of it."""
    file, action, *arguments = sys.argv[1:]
    try:
        report = _survey() if action == "survey" else _keep(*arguments)
    except ConfigError as error:
        report = {"refused": error.args}
    except MemoryError:
        got = f"a network whose search needs more than {SURVEY_MEMORY_BYTES >> 20} MiB"
        report = {"refused": ("network", got, "a smaller network")}
    Path(file).write_text(json.dumps(report))


def _survey() -> dict[str, object]:
    net = read_net(NET)
    map_survey = survey(net, tell=SurveyProgress())
    places = Places(
        items=[FoundPlace.model_validate(fit.told()) for fit in map_survey.fits],
        elsewhere=[Elsewhere.model_validate(misfit.told()) for misfit in map_survey.misfits],
        nowhere=dict(map_survey.nowhere),
    )
    replace_file(Path(PICTURE), map_png(net, map_survey))
    replace_file(Path(ROADS), _roads(net))
    write_sealed(Path(PLACES), places)
    return {}


def _roads(net: Net) -> bytes:
    """Returns the ground of a net as `RoadsBody` has it, to 0.1 m, without signals."""
    ground = [{"use": each.use, "outline": each.outline.round(1).tolist()} for each in surfaces(net)]
    return json.dumps({"surfaces": ground, "signals": []}, separators=(",", ":")).encode()


class SurveyProgress:
    """Writes the share of spots that were looked at, now and then."""

    def __init__(self) -> None:
        self._told = time.monotonic()

    def __call__(self, share: float) -> None:
        """Writes the share if the last one was written long ago."""
        if time.monotonic() - self._told >= TOLD_EVERY_S:
            Path(PROGRESS).write_text(f"{share:.3f}")
            self._told = time.monotonic()


def _keep(name: str, place: str | None = None) -> dict[str, object]:
    pattern: Pattern = next(pattern for pattern in FINDERS if pattern == name)
    chosen = Map(NET)
    fits = chosen.fits(pattern, place)
    if len(fits) > MAX_PLACES:
        raise ConfigError("places", f"{len(fits)} places where {pattern} fits", f"at most {MAX_PLACES}", "name one")
    return {"families": [chosen.keep(fit) for fit in fits]}


if __name__ == "__main__":
    main()
