"""Commands run and end with their own status, whatever the terminal."""

import io
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from unicodedata import category

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Group
from rich.progress import BarColumn, Progress
from rich.table import Table
from rich.text import Text

from risk_sac import cli
from risk_sac.cli.console import Board, columns, folded_table, on_one_line
from risk_sac.host.terminal import complain, console, notes, prepare_streams, printable

EGOS = f"{sys.executable} -m risk_sac egos list"
KEYS = f"{sys.executable} -m service.keys list"
COMMA = """
import locale, sys
from contextlib import closing
from risk_sac.env.env import make_default

locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
with closing(make_default("low")) as env:
    env.reset(seed=1)
    for _ in range(5):
        env.step(env.action_space.sample())
print(locale.localeconv()["decimal_point"])
"""


@pytest.mark.parametrize(
    ("command", "environment"),
    [
        (EGOS, {"PYTHONIOENCODING": "ascii", "COLUMNS": "20", "TERM": "dumb"}),
        (EGOS, {"PYTHONIOENCODING": "latin-1", "LC_ALL": "C"}),
        (f"{EGOS} | true; exit ${{PIPESTATUS[0]}}", {}),
        (f"{EGOS} >&- 2>&- <&-", {}),
    ],
)
def test_a_command_ends_well_whatever_reads_its_output(command, environment):
    done = subprocess.run(["bash", "-c", command], env=os.environ | environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("command", [EGOS, KEYS])
def test_a_full_disk_behind_the_output_is_one_line_and_a_failure(command, tmp_path):
    environment = os.environ | {"RISK_SAC_DATA_DIR": str(tmp_path)}
    done = subprocess.run(
        ["bash", "-c", f"{command} > /dev/full"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert done.stderr.count("\n") == 1


def test_letters_that_a_terminal_lacks_are_written_in_ascii(monkeypatch):
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding="ascii"))
    prepare_streams()
    sys.stdout.write("contacts 3 → valid 2 … λ ≤ 1, Straße \ud800")
    sys.stdout.flush()
    assert written.getvalue() == b"contacts 3 -> valid 2 ... lambda <= 1, Stra?e ?"


@pytest.mark.parametrize(
    ("end", "status", "said"),
    [
        (SystemExit(0), 1, "ended the program"),
        (MemoryError(), 1, "too little memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(28, "No space left on device", "out/results.json"), 1, "out/results.json: No space left on device"),
    ],
)
def test_however_a_command_ends_its_status_says_that_it_is_not_done(end, status, said, monkeypatch, capsys):
    def ending(options):
        raise end

    monkeypatch.setattr("risk_sac.cli.egos._list", ending)
    assert cli.main(["egos", "list"]) == status
    complaint = capsys.readouterr().err
    assert said in complaint
    assert complaint.count("\n") == 1


@pytest.mark.skipif(shutil.which("localedef") is None, reason="no localedef to make a locale with")
def test_a_decimal_comma_of_the_process_does_not_reach_the_simulator(tmp_path):
    made = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")], capture_output=True, check=False
    )
    if not (tmp_path / "de_DE.UTF-8").exists():
        pytest.skip(f"no sources of locales: {made.stderr.decode()}")
    environment = os.environ | {"LOCPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", COMMA], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ",\n"), done.stderr


ANY = st.text(st.characters(exclude_categories=[]))


@given(ANY)
def test_what_is_printable_can_be_put_into_xml(text):
    element = ElementTree.Element("a", {"b": printable(text)})
    element.text = printable(text)
    assert ElementTree.fromstring(ElementTree.tostring(element, "utf-8")).text == (printable(text) or None)


OBEYED = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories of what terminals obey


def commands(text: str) -> list[str]:
    return [each for each in text if category(each) in OBEYED and each not in "\t\n"]


@given(ANY)
def test_printable_text_commands_no_terminal(text):
    assert not commands(printable(text))
    assert printable(printable(text)) == printable(text)


@given(st.dictionaries(ANY, ANY))
def test_a_json_document_stays_the_same_document(document):
    text = json.dumps(document, ensure_ascii=False)
    assert json.loads(printable(text)) == document


def test_text_for_people_stays_as_it_is():
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
def test_whatever_is_printed_shows_control_characters_as_escapes(shown, capsys):
    console.print(shown, markup=False)
    printed = capsys.readouterr().out
    assert r"a\u202eb\u001b[31mc\u2066" in printed
    assert not commands(printed)


def test_bars_and_complaints_show_control_characters_as_escapes(capsys):
    with Progress(*columns(BarColumn(5)), console=notes) as bar:
        Board(bar).show(1, 2, FOREIGN, {FOREIGN: (1, 2)})
    complain(FOREIGN)
    printed = capsys.readouterr().err
    assert printed.count(r"a\u202") == 3
    assert not commands(printed)


def test_a_stream_that_foreign_code_has_closed_costs_the_output_and_is_told(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO()))
    sys.stdout.close()
    assert cli.main(["egos", "list"]) == 1
