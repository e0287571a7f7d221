"""Mutated files are imported or refused in one line, leaving nothing behind."""

import random
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import pytest

from risk_sac.errors import ConfigError
from risk_sac.openscenario.scenario_file import Imported, import_scenario
from risk_sac.scenario.library import written
from risk_sac.scenario.reading import document_from
from tests.openscenario_samples import BODIES, FILES, SCENARIO, VARIATION, WAYS, copied

LONGEST_S = 5.0
LONGEST_LINE = 3_000
VALUES = (
    "", "0", "-1", "1e309", "nan", "INF", "-INF", "1e-300", "999999999999", "true", "false", "Ego", "Walker", "$gap",
    "$road", "$model", "$Ego_kph", "$nothing", "${$gap}", "${-$gap}", "${1/0}", "${sqrt(-1)}", "${acos($gap)}",
    "${$gap % 0}", "${max(1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26,27,28,29,30)}",
    "${pow(10, 400)}", "${" + "(" * 200 + "1" + ")" * 200 + "}", "${" + "-" * 400 + "1}", "${not $brakes and 1}",
    "${__import__('os').system('true')}", "x" * 4_000, "x" * 6_000, "ä\u202e", "../../../../etc/passwd", "catalogs",
    "road.xodr", "cut_in.xosc", "variation.xosc", "step", "linear", "rate", "lessThan", "across", "along", "wagon",
)  # fmt: skip


def _value(tree: ET.Element, draw: random.Random) -> None:
    element = draw.choice([element for element in tree.iter() if element.attrib] or [tree])
    if element.attrib:
        element.set(draw.choice(list(element.attrib)), draw.choice(VALUES))


def _drop_attribute(tree: ET.Element, draw: random.Random) -> None:
    element = draw.choice([element for element in tree.iter() if element.attrib] or [tree])
    if element.attrib:
        del element.attrib[draw.choice(list(element.attrib))]


def _drop(tree: ET.Element, draw: random.Random) -> None:
    parent = draw.choice([element for element in tree.iter() if len(element)] or [tree])
    if len(parent):
        parent.remove(draw.choice(list(parent)))


def _double(tree: ET.Element, draw: random.Random) -> None:
    parent = draw.choice([element for element in tree.iter() if len(element)] or [tree])
    if len(parent):
        parent.append(draw.choice(list(parent)))


def _transplant(tree: ET.Element, draw: random.Random) -> None:
    """Puts an element of any sample below another; never below itself."""
    donor = ET.parse(FILES / draw.choice((SCENARIO, VARIATION, BODIES, WAYS))).getroot()
    draw.choice(list(tree.iter())).append(draw.choice(list(donor.iter())))


def _rename(tree: ET.Element, draw: random.Random) -> None:
    elements = list(tree.iter())
    draw.choice(elements).tag = draw.choice(elements).tag


MUTATIONS: tuple[Callable[[ET.Element, random.Random], None], ...] = (
    _value, _value, _value, _drop_attribute, _drop, _double, _transplant, _rename,
)  # fmt: skip


def mutate(file: Path, draw: random.Random) -> None:
    """Changes a file at up to four places of tree or bytes."""
    if draw.random() < 0.15:
        content = bytearray(file.read_bytes())
        for _ in range(draw.randint(1, 4)):
            at = draw.randrange(len(content) + 1)
            content[at : at + draw.choice((0, 1, 40, 4_000))] = draw.choice(
                (b"", b"<", b"\x00", b"&x;", b"\xff\xfe", b'"')
            )
        file.write_bytes(content)
        return
    tree = ET.parse(file).getroot()
    for _ in range(draw.randint(1, 4)):
        draw.choice(MUTATIONS)(tree, draw)
    try:
        file.write_bytes(ET.tostring(tree))
    except (ValueError, TypeError):  # a character that XML has not
        file.write_bytes(b"")


def try_mutants(folder: Path, seeds: range) -> int:
    """Imports mutated files; returns how many are not refused."""
    imported = 0
    there = copied(folder)
    originals = {path: path.read_bytes() for path in there.rglob("*") if path.is_file()}
    for seed in seeds:
        draw = random.Random(seed)
        mutate(there / draw.choice((SCENARIO, SCENARIO, VARIATION, BODIES, WAYS)), draw)
        began = time.process_time()
        result = _imported(there / draw.choice((SCENARIO, VARIATION)))
        if isinstance(result, ConfigError):
            assert str(result).isprintable(), seed
            assert len(str(result)) < LONGEST_LINE, seed
            assert result.field, seed
        else:
            assert document_from(written(result.document)) == result.document, seed
            imported += 1
        assert time.process_time() - began < LONGEST_S, seed
        assert {path for path in there.rglob("*") if path.is_file()} == originals.keys(), seed
        for path, content in originals.items():
            path.write_bytes(content)
    return imported


def _imported(file: Path) -> Imported | ConfigError:
    try:
        return import_scenario(file, within=file.parent)
    except ConfigError as error:
        return error


@pytest.mark.usefixtures("quick")
def test_mutated_files_are_imported_or_refused(tmp_path: Path) -> None:
    assert 30 <= try_mutants(tmp_path, range(300)) <= 200


@pytest.mark.torture
@pytest.mark.usefixtures("quick")
def test_5000_mutated_files_are_imported_or_refused(tmp_path: Path) -> None:
    try_mutants(tmp_path, range(5_000))
