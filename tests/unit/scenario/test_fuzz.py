"""Mutated documents and distributions are accepted, or refused in one line."""

import copy
import json
import random
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import yaml

from risk_sac.errors import ConfigError
from risk_sac.scenario.check import check_document
from risk_sac.scenario.declared import SceneLaw
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.library import written
from risk_sac.scenario.reading import document_from, nets_of, scenario_file, shipped_names

LONGEST_S = 20.0
LONGEST_LINE = 3_000
DOCUMENTS = [yaml.safe_load(scenario_file(name).read_text()) for name in shipped_names()]
LAWS: list[dict[str, Any]] = [
    {"kind": "uniform", "intervals": [[0, 1], [2, 3]]},
    {"kind": "normal", "mean": 3, "deviation": 2},
    {"kind": "lognormal", "mean": 1, "deviation": 0.5},
    {"kind": "poisson", "expected": 4},
    {"kind": "histogram", "bins": [{"range": [0, 5], "weight": 1}, {"range": [5, 9], "weight": 3}]},
    {"kind": "weights", "weights": [1, 0, 3]},
]
VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1e308, -1e308, 1e-308, 10**400, float("nan"), float("inf"), -float("inf"), "", "0", "nan",
    "ego", "gap", "speed * 1e300 * 1e300", "1 / 0", "1 / (speed - speed)", "((((((1))))))", "(" * 300, "sin(gap)",
    "__import__('os')", "x" * 5_000, "\x00", "ä\u202e", "../../../../etc/passwd", "km/h", [], {}, [[]], [1, 0],
    [float("nan"), 1], [-1e9, 1e9], ["gap", "gap"], {"kind": "normal"}, {"range": [0, 0]}, {"words": []}, *LAWS,
)  # fmt: skip

INSERTED = ("", "&a [*a]", "*a", "{", "- " * 99, "\x00", "\t", "!!python/object:os.system x", "'")


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    """Each container of a document with one of its keys or positions."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield node, key
        yield from _places(value)


def _value(fields: dict[str, Any], draw: random.Random) -> None:
    container, key = draw.choice(list(_places(fields)))
    container[key] = copy.deepcopy(draw.choice(VALUES))


def _drop(fields: dict[str, Any], draw: random.Random) -> None:
    container, key = draw.choice(list(_places(fields)))
    del container[key]


def _transplant(fields: dict[str, Any], draw: random.Random) -> None:
    """Replaces a value by a copy of one of any shipped document."""
    donor, key = draw.choice(list(_places(draw.choice(DOCUMENTS))))
    container, own = draw.choice(list(_places(fields)))
    container[own] = copy.deepcopy(donor[key])


def _rename(fields: dict[str, Any], draw: random.Random) -> None:
    named = [(container, key) for container, key in _places(fields) if isinstance(container, dict)]
    container, key = draw.choice(named)
    container[draw.choice(named)[1]] = container.pop(key)


def _number(fields: dict[str, Any], draw: random.Random) -> None:
    numbers = [(at, key) for at, key in _places(fields) if isinstance(at[key], int | float)]
    if numbers:
        container, key = draw.choice(numbers)
        container[key] = min(container[key], 1e300) * draw.choice((-1, 0, 0.5, 0.9, 0.99, 1.01, 1.1, 2, 1e6))


def _distribution(fields: dict[str, Any], draw: random.Random) -> None:
    """Gives parameters distributions, one of them mutated, and correlates them."""
    parameters = fields.get("parameters")
    if not isinstance(parameters, dict) or not parameters:
        return
    chosen = [name for name in parameters if isinstance(parameters[name], dict)][: draw.randint(1, 3)]
    for name in chosen:
        parameters[name]["distribution"] = copy.deepcopy(draw.choice(LAWS))
    if chosen and draw.random() < 0.7:
        draw.choice((_value, _drop, _number))(parameters[draw.choice(chosen)]["distribution"], draw)
    if draw.random() < 0.5:
        entry = draw.choice((0, 0.5, -0.9, 0.9, 1, 2, float("nan"), "0.5"))
        matrix = [[1 if row == column else entry for column in range(len(chosen))] for row in range(len(chosen))]
        fields["rank_correlation"] = {"parameters": chosen, "spearman": matrix}


MUTATIONS: tuple[Callable[[dict[str, Any], random.Random], None], ...] = (
    _value, _drop, _transplant, _rename, _number, _number, _number, _number, _distribution, _distribution,
)  # fmt: skip


def mutant(draw: random.Random) -> str:
    """Returns a shipped document with up to three changes, or changed text."""
    fields = copy.deepcopy(draw.choice(DOCUMENTS))
    if draw.random() < 0.15:
        text = yaml.safe_dump(fields, allow_unicode=True)
        for _ in range(draw.randint(1, 4)):
            at = draw.randrange(len(text) + 1)
            text = text[:at] + draw.choice(INSERTED) + text[at + draw.choice((0, 1, 40, 4_000)) :]
        return text
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        draw.choice(MUTATIONS)(fields, draw)
    return json.dumps(fields) if draw.random() < 0.3 else yaml.safe_dump(fields, allow_unicode=True)


def refused(text: str) -> ConfigError | None:
    """Reads and checks a document, draws ten scenes; returns the refusal."""
    try:
        document = document_from(text)
        nets = nets_of(document)
        check_document(document, nets)
    except ConfigError as error:
        return error
    assert document_from(written(document)) == document
    space = Interpreter(document, nets).space
    law = SceneLaw.of(space, document.parameters, document.rank_correlation)
    for normal in np.random.default_rng(0).standard_normal((10, space.dimension)):
        scene = space.from_unit(law.point(normal))
        assert np.isfinite(list(scene.values.values())).all()
    return None


def accepted_of(seeds: range) -> int:
    """Tries mutants; returns how many are accepted."""
    accepted = 0
    for seed in seeds:
        began = time.process_time()
        error = refused(mutant(random.Random(seed)))
        assert time.process_time() - began < LONGEST_S, seed
        if error is None:
            accepted += 1
        else:
            assert str(error).isprintable(), seed
            assert len(str(error)) < LONGEST_LINE, seed
    return accepted


def test_mutated_documents_are_accepted_or_refused() -> None:
    assert 20 <= accepted_of(range(250)) <= 150


@pytest.mark.torture
def test_5000_mutated_documents_are_accepted_or_refused() -> None:
    accepted_of(range(5_000))
