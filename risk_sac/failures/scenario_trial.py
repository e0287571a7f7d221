"""Plays a scenario document without an attack, and says what a user has to know before a search."""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import closing

import numpy as np

from risk_sac.config import RunSpec, Scenario
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import EgoFailed, InfeasibleScene, SimulationError
from risk_sac.records.scenario import ScenarioCheck
from risk_sac.scenario.check import check_document, scenes, without_effect
from risk_sac.scenario.families import family_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.limits import limits_from_odd
from risk_sac.scenario.reach import out_of_reach
from risk_sac.world.types import STEP_S

SCENES = 20


def try_document(document: Scenario, nets: Mapping[str, str], count: int = SCENES, seed: int = 0) -> ScenarioCheck:
    """Checks a document, and plays scenes of it with the default ego and undisturbed traffic.

    Args:
      document: of the scenario.
      nets: the file of each network that it names.
      count: scenes.
      seed: of scenes and SUMO.

    Raises:
      ConfigError: the document has a fault, with its path.
    """
    check_document(document, nets)
    of, family = Interpreter(document, nets), family_of(document, nets)
    spec = RunSpec(family=document.name, method="random", seed=0, requirements=document.requirements)
    problem = Problem.from_spec(spec, family)
    refused, invalid, played, contacts, steps = Counter[str](), dict[str, None](), 0, 0, 0
    with closing(RiskSacEnv(problem, spec.learner.reward, controlled=False)) as env:
        for index in range(count):
            draw = np.random.default_rng((seed, index))
            scene = problem.space.from_unit(draw.random(problem.space.dimension))
            try:
                env.reset(seed=int(draw.integers(2**31 - 1)), options={"scene": scene})
                played += 1
                ended = False
                while not ended:
                    *_, touched, truncated, _ = env.step(np.zeros(env.action_size, dtype=np.float32))
                    ended, steps, contacts = touched or truncated, steps + 1, contacts + touched
            except InfeasibleScene as infeasible:
                refused[infeasible.reason] += 1
            except (SimulationError, EgoFailed) as error:
                invalid[str(error)] = None
    checked = ScenarioCheck(
        name=document.name,
        scenes=count,
        played=played,
        refused=dict(refused),
        contacts=contacts,
        invalid=tuple(invalid),
        out_of_reach=tuple(out_of_reach(_layouts(of), limits_from_odd(family.odd, 1.0))),
        without_effect=tuple(without_effect(of)),
        seconds=round(steps * STEP_S, 1),
    )
    return checked.model_copy(update={"remarks": tuple(_remarks(checked))})


def _remarks(checked: ScenarioCheck) -> Iterator[str]:
    """Lists what is to be mended, one sentence each."""
    if checked.contacts:
        yield f"the default ego touches something in {checked.contacts} of {checked.played} scenes unattacked"
    if not checked.played:
        yield "every scene is refused: move the starts apart, or lower the speeds"
    elif 2 * checked.played < checked.scenes:
        yield f"{checked.scenes - checked.played} of {checked.scenes} scenes are refused: a search loses them"
    yield from (f"{name} cannot come near the ego's way within the horizon" for name in checked.out_of_reach)
    yield from (f"the parameter {name} changes no start" for name in checked.without_effect)
    yield from (f"an episode ended early: {why}" for why in checked.invalid)


def _layouts(of: Interpreter) -> list[Layout]:
    layouts = list[Layout]()
    for scene in scenes(of, 30):
        try:
            layouts.append(of.layout(scene.values))
        except InfeasibleScene:
            continue
    return layouts
