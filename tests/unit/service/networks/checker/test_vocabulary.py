"""The allow-list, beside the schemas that come with SUMO's own tools."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import sumo

from service.networks.checker.vocabulary import VOCABULARIES, Element

SCHEMAS = sorted((Path(sumo.SUMO_HOME) / "data" / "xsd").rglob("*.xsd"))
ELEMENTS = [(kind, tag, element) for kind, items in VOCABULARIES.items() for tag, element in items.items()]
WRITES = re.compile("(?<!pro)file|output|dest|href|path", re.IGNORECASE)


def declared(what: str) -> set[str]:
    pattern = f".//{{http://www.w3.org/2001/XMLSchema}}{what}"
    return {str(node.get("name")) for schema in SCHEMAS for node in ET.parse(schema).iterfind(pattern)}


def test_every_name_is_one_of_sumos() -> None:
    assert {tag for _, tag, _ in ELEMENTS} <= declared("element") | {"net", "routes", "additional"}
    assert {name for _, _, element in ELEMENTS for name in element.attributes} <= declared("attribute") | {
        "lcContRight",  # of vehicle types; the schema's list ends before it
    }


@pytest.mark.parametrize(("kind", "tag", "element"), ELEMENTS, ids=[f"{kind}-{tag}" for kind, tag, _ in ELEMENTS])
def test_no_element_names_a_file(kind: str, tag: str, element: Element) -> None:
    assert not [name for name in (tag, *element.attributes) if WRITES.search(name)]
    assert element.required <= element.attributes.keys()
    assert all(parent in VOCABULARIES[kind] or parent == "document" for parent in element.inside)


def test_vehicles_take_no_parameters_which_could_switch_on_devices_that_write() -> None:
    inside = set().union(*(items["param"].inside for items in VOCABULARIES.values() if "param" in items))
    assert inside == {"net", "edge", "lane", "junction", "connection", "poly", "poi"}
