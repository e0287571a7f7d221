import xml.etree.ElementTree as ElementTree

from hypothesis import given
from hypothesis import strategies as st

from risk_sac.cli.console import on_one_line
from risk_sac.terminal import printable

ANY = st.text(st.characters(exclude_categories=[]))


@given(ANY)
def test_what_is_printable_can_be_put_into_xml(text: str) -> None:
    element = ElementTree.Element("a", {"b": printable(text)})
    element.text = printable(text)
    assert ElementTree.fromstring(ElementTree.tostring(element, "utf-8")).text == (printable(text) or None)


@given(ANY)
def test_a_line_tells_a_terminal_nothing(text: str) -> None:
    assert not set(on_one_line(text)) & {*map(chr, range(0x20)), *map(chr, range(0x7F, 0xA0)), "\u2028", "\u2029"}


def test_text_for_people_stays_as_it_is() -> None:
    assert printable("λ\tÄ\n\U0001f697") == "λ\tÄ\n\U0001f697"
    assert on_one_line("\x1b[31mred\x1b[0m\r\n two") == "[31mred[0m two"
