"""Runs that have been begun."""

from service.store.reading import Store
from service.store.writing import Ledger


def start(store: Store, ledger: Ledger) -> int:
    """Begins the run that has waited longest; returns its number."""
    number = store.waiting()["default"]
    ledger.start_run(number)
    return number
