import json
import xml.etree.ElementTree as ElementTree
from unicodedata import category

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Group, RenderableType
from rich.progress import BarColumn, Progress
from rich.table import Table
from rich.text import Text

from risk_sac.cli.console import Board, columns, folded_table, on_one_line
from risk_sac.terminal import complain, console, notes, printable

ANY = st.text(st.characters(exclude_categories=[]))


@given(ANY)
def test_what_is_printable_can_be_put_into_xml(text: str) -> None:
    element = ElementTree.Element("a", {"b": printable(text)})
    element.text = printable(text)
    assert ElementTree.fromstring(ElementTree.tostring(element, "utf-8")).text == (printable(text) or None)


OBEYED = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories of what terminals obey


def commands(text: str) -> list[str]:
    return [each for each in text if category(each) in OBEYED and each not in "\t\n"]


@given(ANY)
def test_printable_text_commands_no_terminal(text: str) -> None:
    assert not commands(printable(text))
    assert printable(printable(text)) == printable(text)


@given(st.dictionaries(ANY, ANY))
def test_a_json_document_stays_the_same_document(document: dict[str, str]) -> None:
    text = json.dumps(document, ensure_ascii=False)
    assert json.loads(printable(text)) == document


def test_text_for_people_stays_as_it_is() -> None:
    assert printable("λ\tÄ\n\U0001f697\u3000\xa0") == "λ\tÄ\n\U0001f697\u3000\xa0"
    assert printable("a\u202eb\x1b[0m\U000e0001") == r"a\u202eb\u001b[0m\udb40\udc01"
    assert on_one_line("a\r\n \u2028 two") == "a two"


FOREIGN = "a\u202eb\x1b[31mc\u2066"


@pytest.mark.parametrize(
    "shown",
    [
        FOREIGN,
        Text(FOREIGN, style="red"),
        Table(FOREIGN, title=FOREIGN, caption=FOREIGN),
        Group(FOREIGN, Text(FOREIGN)),
        folded_table(["name"], [[FOREIGN]]),
    ],
)
def test_whatever_is_printed_shows_control_characters_as_escapes(
    shown: RenderableType, capsys: pytest.CaptureFixture[str]
) -> None:
    console.print(shown, markup=False)
    printed = capsys.readouterr().out
    assert r"a\u202eb\u001b[31mc\u2066" in printed
    assert not commands(printed)


def test_bars_and_complaints_show_control_characters_as_escapes(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress(*columns(BarColumn(5)), console=notes) as bar:
        Board(bar).show(1, 2, FOREIGN, {FOREIGN: (1, 2)})
    complain(FOREIGN)
    printed = capsys.readouterr().err
    assert printed.count(r"a\u202") == 3
    assert not commands(printed)
