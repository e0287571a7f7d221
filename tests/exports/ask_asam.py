"""In the checkers' environment: prints findings of ASAM's checkers, as JSON."""

import json
import logging
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import qc_opendrive.main
import qc_openscenario.main

BUNDLES = {".xosc": ("xoscBundle", qc_openscenario.main), ".xodr": ("xodrBundle", qc_opendrive.main)}
CONFIG = """<Config><Param name="InputFile" value="{file}"/>
<CheckerBundle application="{bundle}"><Param name="resultFile" value="{result}"/></CheckerBundle></Config>"""


def check(file: Path) -> dict[str, tuple[str, list[str]]]:
    bundle, program = BUNDLES[file.suffix]
    with tempfile.TemporaryDirectory() as folder:
        config, result = Path(folder) / "config.xml", Path(folder) / "result.xqar"
        config.write_text(CONFIG.format(file=file.resolve(), bundle=bundle, result=result))
        sys.argv = ["qc", "-c", str(config)]
        program.main()
        checkers = ET.parse(result).getroot().iter("Checker")
        return {
            each.get("checkerId"): (each.get("status"), [issue.get("description") for issue in each.iter("Issue")])
            for each in checkers
        }


logging.disable(logging.CRITICAL)
found = {name: check(Path(name)) for name in sys.argv[1:]}
print(json.dumps(found))
