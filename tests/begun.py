"""Runs that have been begun."""

from risk_sac.records import State
from service.store.reading import Store
from service.store.stored import StoredRun
from service.store.writing import Ledger

BEGUN = StoredRun(
    number=1,
    campaign_id="c",
    id="low-sac-0",
    family="low",
    method="sac",
    seed=0,
    spec_digest="",
    state=State.RUNNING,
    reason=None,
    started_at=None,
    finished_at=None,
    episodes_total=100,
    episodes_done=0,
    rejected=0,
    raw_collisions=0,
    failures=0,
    distinct_failures=0,
    preventable=0,
    distinct_preventable=0,
    busy_s=0.0,
    attempts=1,
    metrics=None,
    evaluation=None,
    digest=None,
    versions={},
    repetitions={},
)


def start(store: Store, ledger: Ledger) -> int:
    """Begins the run that has waited longest; returns its number."""
    number = store.waiting()["default"]
    ledger.start_run(number)
    return number
