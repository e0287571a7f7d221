from collections.abc import Callable

import pytest

from risk_sac.config import CampaignSpec, RunSpec
from risk_sac.metrics import results_digest
from risk_sac.report import FinishedRun
from risk_sac.types import Collision, EpisodeRecord, Grade, Judgement, Outcome
from tests.judged import judgement


def collision(speed: float = 10.0, other: str = "lead", broken: str = "", judged: Judgement | None = None) -> Collision:
    return Collision(
        time_s=3.0,
        other_id=other,
        other_kind="vehicle",
        other_role="adversary",
        contact_x_m=2.0,
        contact_y_m=0.1,
        ego_zone="front",
        other_zone="rear",
        ego_speed_mps=12.0,
        other_speed_mps=2.0,
        relative_speed_mps=speed,
        lateral_offset_m=0.0,
        min_ttc_s=0.3,
        min_rss_margin_m=-4.0,
        visible_for_s=2.0,
        ego_peak_braking_mps2=4.5,
        min_robustness=-1.0,
        simulator_agrees=True,
        verdicts={rule: rule != broken for rule in ("inside_limits", "ego_moving")},
        judgement=judged,
    )


OUTCOMES = {
    ".": (Outcome.SAFE, None),
    "r": (Outcome.REJECTED, None),
    "f": (Outcome.FAILURE, collision(judged=judgement(conflict_s=1.5))),
    # Another failure than f, which no careful driver would have prevented.
    "F": (
        Outcome.FAILURE,
        collision(speed=20.0, judged=judgement(Grade.IDEAL, -0.5, unresponsive=True, signature="leader, straight")),
    ),
    "a": (Outcome.DEGENERATE, collision(broken="inside_limits")),
    "d": (Outcome.DEGENERATE, collision(broken="ego_moving")),
}


@pytest.fixture
def finished() -> Callable[..., FinishedRun]:
    """Builds a run from one letter per episode, see `OUTCOMES`; every episode that is not rejected has 50 steps."""

    def build(spec: RunSpec, search: str, evaluation: str = "", cpu_s: float = 60.0) -> FinishedRun:
        records = []
        for index, letter in enumerate(search + evaluation):
            outcome, hit = OUTCOMES[letter]
            records.append(
                EpisodeRecord(
                    index=index,
                    phase="train" if index < len(search) else "evaluate",
                    seed=index,
                    scene={"lead_gap_m": 12.5},
                    outcome=outcome,
                    reason="",
                    steps=0 if letter == "r" else 50,
                    risk_return=1.0,
                    shaped_return=0.5,
                    mean_cost=0.2,
                    min_ttc_s=0.3,
                    min_robustness=-1.0,
                    objective=None,
                    dual_variable=0.1 * index,
                    temperature=0.2,
                    environment_steps=50 * (index + 1),
                    collision=hit,
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
def spec() -> CampaignSpec:
    return CampaignSpec.model_validate(
        {
            "families": ("low",),
            "methods": ("sac", "risk-sac", "no-adversary"),
            "seeds": (0, 1),
            "budget": {"episodes": 4, "evaluation_episodes": 1},
        }
    )


@pytest.fixture
def runs(spec: CampaignSpec, finished: Callable[..., FinishedRun]) -> list[FinishedRun]:
    letters = {
        ("risk-sac", 0): ("ffF.", "f"),
        ("risk-sac", 1): ("f..r", "."),
        ("sac", 0): ("..da", "."),
        ("sac", 1): ("...f", "."),
        ("no-adversary", 0): ("....", "."),
        ("no-adversary", 1): ("a...", "."),
    }
    return [finished(run, *letters[run.method, run.seed]) for run in spec.runs()]
