"""The page, a map's picture and the command line call the patterns alike."""

import re
from typing import get_args

from risk_sac.failures.map_picture import MARKS
from risk_sac.scenario.maps.found import TITLES, Pattern
from tests.server import ROOT

PAGE = ROOT / "service" / "web" / "src" / "screens" / "maps" / "places.ts"


def test_the_page_titles_the_patterns_as_the_code_does() -> None:
    told = re.findall(r'\{ name: "(\w+)", title: "([^"]+)"', PAGE.read_text(encoding="utf-8"))
    assert dict(told) == TITLES
    assert set(TITLES) == set(MARKS) == set(get_args(Pattern))
