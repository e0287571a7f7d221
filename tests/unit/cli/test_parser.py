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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("shwo", "there is no 'shwo'; did you mean show?"),
        ("campaigns lst", "did you mean list?"),
        ("run --family low --episdes 3 --out x", "there is no flag --episdes; did you mean --episodes?"),
        ("run --family lwo --out x", '--family: got "lwo"'),
        ("run --family lwo --out x", "did you mean low?"),
        ("run --family low --method archve --out x", "did you mean archive?"),
        ("run --family low --ego r175 --out x", "did you mean r157?"),
        ("run --family low --ego nobody --out x", "--ego: got 'nobody'; wanted one of broken, "),
        (
            "run --family low --ego my_egos:AccLka --out x",
            "--ego: got my_egos:AccLka, which cannot be used: there is no",
        ),
        ("run --family low --ego risk_sac.egos.r157:Acc --out x", "r157.py: it has no class 'Acc'"),
        ("run --family low --ego risk_sac.egos.r157:R157 --out x", "R157, which is not registered; wanted the name of"),
        ("run --family low --ego nowhere.yaml --out x", "--ego: got 'nowhere.yaml', which is no file; wanted default,"),
        ("regress --failures x.npz --ego nobody", "--ego: got 'nobody'; wanted one of broken, "),
        ("regress --failures x.npz --ego idm-aeb+blnd-right", "such as blind-right"),
        ("regress --failures x.npz --ego careful", "--failures: got /"),
        ("regress --failures x.npz --ego careful --format gif", "--format: got it without --exports"),
        ("replay nowhere.npz", "BUNDLE: got /"),
        ("places nowhere.osm", "MAP: got /"),
        (
            "run --network nowhere.osm --pattern crossing --place x --out x",
            "--network: got nowhere.osm, which cannot be",
        ),
        ("run --family low --network x.osm --out x", "--family: got it beside --network; wanted one of them"),
        ("evaluate --families low --network x.osm --out x", "--families: got it beside --network"),
        (
            "run --family low --odd x.yaml --out x",
            "there is no flag --odd; write odd into a file and name it with --spec",
        ),
        ("show --learner x.yaml", "there is no flag --learner\n"),
        ("export x.npz --format openscenariox --out y", "did you mean openscenario?"),
        ("run --method archive --out x", "--family is missing; choose low, mixed or dense"),
        ("run --family low", "--out"),
        ("run --methd archive", "there is no flag --methd; did you mean --method?"),
        ("run --methd=archive", "there is no flag --methd; did you mean --method?"),
        ("campaigns watch --ur http://x --jsno", "there is no flag --jsno"),
        ("run --family low --out x more", "'more' is one argument too many"),
        ("evaluate --families low --seeds 0 --out x", "--seeds: got 0"),
    ],
)
def test_a_wrong_word_is_named_as_typed_beside_what_is_close(words, said, capsys):
    try:
        status = cli.main(words.split())
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    assert said in capsys.readouterr().err
