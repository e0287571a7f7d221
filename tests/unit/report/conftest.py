import pytest

from risk_sac.config import CampaignSpec
from risk_sac.metrics import results_digest
from risk_sac.records import Collision, DrivenBy, Fault, Grade, Judgement, Outcome, RequirementResult, Severity
from risk_sac.report import FinishedRun
from tests.builders import collision, episode_record, judgement, violation

NOT_GRADED = judgement(None)


def hit(speed: float = 10.0, broken: str = "", judged: Judgement = NOT_GRADED) -> Collision:
    verdicts = {rule: rule != broken for rule in ("inside_limits", "ego_moving")}
    return collision(relative_speed_mps=speed, verdicts=verdicts, judgement=judged)


LEADER = judgement(
    Grade.FULL_BRAKING,
    -0.5,
    unresponsive=True,
    kind="leader, straight",
    severity=Severity.SEVERE,
    fault=Fault.SHARED,
)
OUTCOMES = {
    ".": (Outcome.SAFE, None),
    "r": (Outcome.REJECTED, None),
    "f": (Outcome.FAILURE, hit(judged=judgement(conflict_s=1.5))),
    # Another failure than f, which only full braking at once would have prevented.
    "F": (Outcome.FAILURE, hit(speed=20.0, judged=LEADER)),
    "a": (Outcome.DEGENERATE, hit(broken="inside_limits")),
    "d": (Outcome.DEGENERATE, hit(broken="ego_moving")),
}


def results(**violated_s: float | None) -> dict[str, RequirementResult]:
    """Of these requirements, when each was violated; `safe_ttc` is reported only."""
    return {
        name: RequirementResult(
            counts="report" if name == "safe_ttc" else "failure",
            robustness=1.0 if time_s is None else -0.4,
            violated_s=time_s,
        )
        for name, time_s in violated_s.items()
    }


# Of a newer run, whose requirements were counted: all are kept, one is violated without contact.
OUTCOMES |= {"k": (Outcome.SAFE, None), "v": (Outcome.FAILURE, None)}
OUTCOMES |= {"p": OUTCOMES["."], "s": OUTCOMES["f"]}
NEWER = {
    "p": {"driven_by": DrivenBy.POLICY},
    "s": {"driven_by": DrivenBy.SCRIPT},
    "k": {"requirements": results(no_contact=None, safe_ttc=None, never_fast=None)},
    "v": {
        "requirements": results(no_contact=None, safe_ttc=0.5, never_fast=1.5),
        "violations": (violation(grade=Grade.PREVENTABLE),),
        "failed": ("never_fast",),
    },
}


@pytest.fixture
def finished():
    """Builds a run from `OUTCOMES` letters; played episodes have 50 steps."""

    def build(spec, search, evaluation="", cpu_s=60.0):
        records = []
        for index, letter in enumerate(search + evaluation):
            outcome, contact = OUTCOMES[letter]
            records.append(
                episode_record(
                    index,
                    outcome,
                    phase="search" if index < len(search) else "evaluation",
                    steps=0 if letter == "r" else 50,
                    environment_steps=50 * (index + 1),
                    mean_cost=0.2,
                    dual_variable=0.1 * index,
                    collision=contact,
                    **NEWER.get(letter, {}),
                )
            )
        return FinishedRun(
            spec=spec,
            digest=results_digest(records),
            records=tuple(records),
            versions={"numpy": "2.4"},
            wall_s=2 * cpu_s,
            cpu_s=cpu_s,
        )

    return build


@pytest.fixture
def spec():
    return CampaignSpec.model_validate(
        {
            "families": ("low",),
            "methods": ("sac", "risk-sac", "no-adversary"),
            "seeds": (0, 1),
            "budget": {"episodes": 4, "evaluation_episodes": 1},
        }
    )


@pytest.fixture
def runs(spec, finished):
    letters = {
        ("risk-sac", 0): ("ffF.", "f"),
        ("risk-sac", 1): ("f..r", "."),
        ("sac", 0): ("..da", "."),
        ("sac", 1): ("...f", "."),
        ("no-adversary", 0): ("....", "."),
        ("no-adversary", 1): ("a...", "."),
    }
    return [finished(run, *letters[run.method, run.seed]) for run in spec.runs()]
