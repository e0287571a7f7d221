"""Campaigns of known times and ids, written as manager and workers do."""

import itertools
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import pytest

from risk_sac.config import CampaignSpec, RunSpec
from risk_sac.execution.messages import EpisodeDone, Finished
from risk_sac.metrics import results_digest
from risk_sac.records import (
    NO_CONTACT,
    Collision,
    EpisodeRecord,
    Fault,
    Grade,
    Judgement,
    Outcome,
    RequirementResult,
    Severity,
    State,
    stored,
)
from risk_sac.report import FinishedRun
from risk_sac.run_folder.results import EPISODES, FAILURES, RecordedFailure, RunResults, series_name, write_results
from risk_sac.run_folder.series import PER_ACTOR, PER_OTHER, pack_series, write_series
from risk_sac.scenario.bodies import CODES
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign, StoredRun
from service.store.writing import Ledger
from tests.builders import LOW_SCENE, collision, episode_record, judgement, violation

BEGAN = 1_750_000_000.0
ENDED_ID, LIVE_ID, CANCELLED_ID, POSTED_ID = (f"c{number:016x}" for number in range(1, 5))
VERSIONS = {"numpy": "2.4", "sumo": "1.28"}
FOUND, NOTHING = ".fF.drv", ".a.r.."  # a letter for each episode, see `OUTCOMES`


NOT_GRADED = judgement(None)


def hit(judged: Judgement = NOT_GRADED, broken: str = "", least_ttc_s: float = 0.3) -> Collision:
    verdicts = {rule: rule != broken for rule in ("inside_limits", "ego_moving")}
    return collision(early_min_ttc_s=least_ttc_s, verdicts=verdicts, judgement=judged)


OWN = {"name": "never_fast", "formula": "ego_speed_mps <= 5", "scale": 10.0}
SLOW = violation(grade=Grade.PREVENTABLE, broke=("speeding",))
LEADER = judgement(
    Grade.FULL_BRAKING,
    -0.5,
    unresponsive=True,
    kind="leader",
    severity=Severity.SEVERE,
    injury_risk=0.02,
    harm="serious injury",
    fault=Fault.SHARED,
)
OUTCOMES = {
    ".": (Outcome.SAFE, "", None),
    "r": (Outcome.REJECTED, "sim_crash", None),
    "f": (Outcome.FAILURE, "", hit(judgement())),
    "F": (Outcome.FAILURE, "", hit(LEADER)),
    "a": (Outcome.DEGENERATE, "inside_limits", hit(broken="inside_limits", least_ttc_s=math.inf)),
    "d": (Outcome.DEGENERATE, "ego_moving", hit(broken="ego_moving")),
    "v": (Outcome.FAILURE, "", None),  # with `SLOW`
}


def kept(contact: Collision | None, violated: bool) -> dict[str, RequirementResult]:
    """What an episode says of each requirement."""
    touched_s = None if contact is None else contact.time_s
    return {
        NO_CONTACT: RequirementResult(counts="failure", robustness=0.2, violated_s=touched_s),
        "safe_ttc": RequirementResult(counts="report", robustness=-0.5, violated_s=0.5),
        "never_fast": RequirementResult(
            counts="failure",
            robustness=SLOW.robustness if violated else 0.1,
            violated_s=SLOW.time_s if violated else None,
        ),
    }


def record(index: int, letter: str, phase: str) -> EpisodeRecord:
    outcome, reason, contact = OUTCOMES[letter]
    return episode_record(
        index,
        outcome,
        phase=phase,
        seed=index + 7,
        scene=LOW_SCENE | {"lead_gap_m": 12.5 + index},
        reason=reason,
        steps=0 if letter == "r" else 50,
        environment_steps=50 * (index + 1),
        mean_cost=0.25,
        min_ttc_s=9.5 if contact is None else contact.early_min_ttc_s,
        min_robustness=0.2 if contact is None else -1.0,
        objective=None if index == 0 else 0.75,
        dual_variable=0.5 * index,
        temperature=0.25,
        requirements={} if letter == "r" else kept(contact, letter == "v"),
        failed=(() if outcome is not Outcome.FAILURE else (NO_CONTACT if contact else "never_fast",)),
        violations=(SLOW,) if letter == "v" else (),
        collision=contact,
    )


def records(letters: str, evaluation: str = "") -> list[EpisodeRecord]:
    search = [record(index, letter, "search") for index, letter in enumerate(letters)]
    return search + [record(index, letter, "evaluation") for index, letter in enumerate(evaluation, len(letters))]


def finished(spec: RunSpec, done: Sequence[EpisodeRecord]) -> FinishedRun:
    return FinishedRun(
        spec=spec, digest=results_digest(done), records=tuple(done), versions=VERSIONS, wall_s=30.0, cpu_s=20.0
    )


def series_arrays() -> dict[str, np.ndarray]:
    """Three steps of two actors, one absent in the second step."""
    rows = np.arange(6, dtype=float).reshape(3, 2)
    rows[1, 1] = np.nan
    return dict.fromkeys((*PER_ACTOR, *PER_OTHER), rows) | {
        "y_m": 10 * rows,  # side by side before the contact
        "time_s": np.arange(3) / 10,
        "released_s": np.array(0.0),
        "ids": np.array(["ego", "lead"]),
        "kind": np.array([0, 1], dtype=np.int8),
        "body": np.array([CODES["car"], CODES["pedestrian"]], dtype=np.int8),
        "role": np.array([0, 1], dtype=np.int8),
        "length_m": np.array([4.6, 0.5]),
        "width_m": np.array([1.8, 0.5]),
        "visible": np.array([[np.nan, 1.0], [np.nan, np.nan], [np.nan, 0.0]]),
        "requirements": np.array(["safe_ttc"]),
        "robustness": np.array([[1.0], [np.inf], [-1.0]]),
        "soft_min": np.zeros(3),
        "actions": np.zeros((3, 4), dtype=np.float32),
        "signal": np.array([0, 3, 1], dtype=np.int8),
    }


class Clock:
    """Time of day that stands still until it is told to pass."""

    def __init__(self) -> None:
        self.now = BEGAN

    def __call__(self) -> float:
        return self.now


@contextmanager
def known_times_and_ids() -> Iterator[Clock]:
    """Makes times and ids of the service known within the body."""
    clock, ids = (
        Clock(),
        itertools.chain((ENDED_ID, LIVE_ID, CANCELLED_ID, POSTED_ID), map("{:016x}".format, itertools.count())),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, "time", clock)
        patch.setattr("secrets.token_bytes", bytes)
        patch.setattr("secrets.token_hex", lambda _: next(ids).removeprefix("c"))
        yield clock


class Recorded:
    """Fills the database of a service that has not started."""

    def __init__(self, settings: ServiceSettings, clock: Clock) -> None:
        self._settings = settings
        self._clock = clock
        self._store = Store(settings.url)
        self._ledger = Ledger(self._store)

    def write(self) -> None:
        """Writes three campaigns: one ended, one at work, one cancelled while waiting."""
        self._ended()
        self._live()
        cancelled = self._ledger.create(CampaignSpec(families=("dense",), methods=("random",), label="cancelled"))
        self._clock.now += 5
        self._ledger.cancel(cancelled.id)
        self._clock.now += 5
        self._store.close()

    def _ended(self) -> None:
        """One run found failures after losing a worker; the other failed."""
        campaign = self._create("ended", episodes=len(FOUND), evaluation=2)
        first, second = campaign.runs
        done = records(FOUND, "f.")
        self._ledger.start_run(first.number)
        self._report(campaign, first, done[:3])
        self._ledger.requeue_run(first.number, "worker was killed by SIGKILL; goes on from its checkpoint")
        self._ledger.start_run(first.number)
        self._report(campaign, first, done)
        self._finish(campaign, first, done)
        self._ledger.start_run(second.number)
        self._report(campaign, second, records(NOTHING)[:4])
        self._clock.now += 1
        self._ledger.end_run(second.number, State.FAILED, "worker exited with status 1: Traceback: the policy is NaN")

    def _live(self) -> None:
        """One run is at work, the other has its episodes to come."""
        campaign = self._create("live", episodes=len(NOTHING), evaluation=0)
        first, _ = campaign.runs
        self._ledger.start_run(first.number)
        self._report(campaign, first, records(NOTHING)[:5])

    def _create(self, label: str, episodes: int, evaluation: int) -> StoredCampaign:
        self._clock.now += 60
        budget = {"episodes": episodes, "evaluation_episodes": evaluation}
        spec = CampaignSpec.model_validate(
            {
                "label": label,
                "families": ("low",),
                "methods": ("risk-sac", "random"),
                "seeds": (3,),
                "budget": budget,
                "requirements": [OWN],
            }
        )
        campaign = self._ledger.create(spec, key=f"key of {label}")
        self._clock.now += 1
        return campaign

    def _report(self, campaign: StoredCampaign, run: StoredRun, done: Sequence[EpisodeRecord]) -> None:
        folder, spec = self._settings.run_folder(campaign.id, run.id), campaign.run_spec(run)
        for count, episode in enumerate(done, 1):
            self._clock.now += 1
            file = folder / FAILURES / series_name(episode.index)
            kept = (
                None
                if episode.worst_violation is None
                else write_series(file, pack_series(series_arrays() | {"released_s": np.array(0.0)}))
            )
            metrics = finished(spec, done[:count]).metrics
            word = EpisodeDone(
                record=episode,
                metrics=metrics["evaluation" if episode.phase == "evaluation" else "search"],
                series=kept and kept.name,
                series_sha256=kept and kept.sha256,
                wall_s=0.5,
            )
            self._ledger.add_episodes([(run.number, word)])

    def _finish(self, campaign: StoredCampaign, run: StoredRun, done: Sequence[EpisodeRecord]) -> None:
        folder, spec = self._settings.run_folder(campaign.id, run.id), campaign.run_spec(run)
        result = finished(spec, done)
        write_results(
            folder,
            RunResults(
                spec=spec,
                spec_digest=spec.digest,
                finished=True,
                metrics=result.metrics["search"],
                evaluation=result.metrics["evaluation"],
                digest=result.digest,
                versions=VERSIONS,
                device="cpu",
                wall_s=result.wall_s,
                cpu_s=result.cpu_s,
                failures=tuple(RecordedFailure.of(spec.id, each) for each in done if each.worst_violation is not None),
            ),
        )
        (folder / EPISODES).write_text("".join(stored(each) + "\n" for each in done))
        last = Finished(
            finished=True,
            metrics=result.metrics["search"],
            evaluation=result.metrics["evaluation"],
            digest=result.digest,
            versions=VERSIONS,
            wall_s=30.0,
        )
        self._ledger.end_run(run.number, State.SUCCEEDED, result=last)
