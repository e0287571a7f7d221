import re
import shlex
from argparse import _SubParsersAction
from collections.abc import Iterator

import pytest

from risk_sac import cli
from risk_sac.cli.parser import Parser


def leaves(parser: Parser) -> Iterator[Parser]:
    """All commands, those of groups included."""
    groups = [action for action in parser._actions if isinstance(action, _SubParsersAction)]
    yield parser
    for group in groups:
        for each in group.choices.values():
            if each.description:  # `keys` hands its words on
                yield from leaves(each)


COMMANDS = {parser.prog: parser for parser in leaves(cli._parser())}


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_a_paragraph_an_example_that_parses_and_fits_80_columns(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    text = COMMANDS[name].format_help()
    assert all(len(line) <= 80 for line in text.splitlines()), text
    example = re.search(r"^example:\n((?:  .*\n?)+)", text, re.MULTILINE)
    assert example is not None, text
    words = shlex.split(example[1].replace("\\\n", ""))
    assert words[0] == "risk-sac"
    options, unknown = cli._parser().parse_known_args(words[1:])
    assert not unknown
    assert options.parser.prog.startswith(name)


@pytest.mark.parametrize("names", cli.COMMANDS.values())
def test_a_command_is_there_when_only_its_own_module_is_loaded(names):
    added = next(leaves(cli._parser(names)))._subparsers
    assert added is not None
    assert tuple(added._group_actions[0].choices or ()) == names


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("shwo", "did you mean show?"),
        ("campaigns lst", "did you mean list?"),
        ("run --scenario low --episdes 3 --out x", "there is no flag --episdes; did you mean --episodes?"),
        ("run --scenario lwo --out x", "did you mean low?"),
        ("run --scenario low --method archve --out x", "did you mean archive?"),
        ("run --scenario low --ego my_egos:AccLka --out x", "--ego: "),
        ("run --scenario low --ego risk_sac.egos.shipped:R157 --out x", "--ego: "),
        ("regress --failures x.npz --ego careful", "--failures: "),
        ("replay nowhere.npz", "BUNDLE: "),
        ("places nowhere.osm", "MAP: "),
        ("run --network nowhere.osm --pattern crossing --place x --out x", "--network: "),
        ("run --scenario low --network x.osm --out x", "--scenario: "),
        ("run --scenario low --odd x.yaml --out x", "there is no flag --odd"),
        ("run --method archive --out x", "--scenario is missing"),
        ("run --methd=archive", "did you mean --method?"),
        ("run --scenario low --out x more", "'more'"),
    ],
)
def test_a_wrong_word_is_named_as_typed_beside_what_is_close(words, said, capsys):
    try:
        status = cli.main(words.split())
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    assert said in capsys.readouterr().err


def test_keys_hands_its_words_on_with_their_flags():
    words = ["create", "--project", "default", "--scope", "run"]
    assert cli._parser().parse_known_args(["keys", *words])[0].rest == words


def test_a_flag_may_be_shortened_and_words_after_two_dashes_are_no_flags():
    options, unknown = cli._parser().parse_known_args(["run", "--scen", "low", "--out", "x"])
    assert (options.family, unknown) == ("low", [])
    assert cli._parser().parse_known_args(["show", "--", "--results"])[0].results.name == "--results"
