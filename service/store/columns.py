"""Columns of very many rows: verified like any row, without the object that is made of one, which costs most of it."""

from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import Any

from sqlalchemy import ColumnElement, inspect, select
from sqlalchemy.orm import Session

from service.store.tables import Checked, checksum_of, damaged, summed_columns

BATCH = 1000  # rows in memory at once


def read_columns(
    session: Session, table: type[Checked], names: Sequence[str], *conditions: ColumnElement[bool]
) -> Iterator[tuple[Any, ...]]:
    """Values of two or more columns, by the numbers of their rows.

    Raises:
      StorageError: a row is damaged.
    """
    mapper = inspect(table)
    every = list(mapper.columns.keys())
    first, later = ([every.index(name) for name in group] for group in summed_columns(mapper))
    number, checksum = every.index("number"), every.index("checksum")
    summed, wanted = itemgetter(*first), itemgetter(*map(every.index, names))
    query = select(*mapper.columns).where(*conditions).order_by(mapper.columns["number"])
    for row in session.execute(query.execution_options(yield_per=BATCH)):
        values = tuple(row)
        if values[checksum] not in (None, checksum_of(summed(values), tuple(values[each] for each in later))):
            raise damaged(table, values[number])
        yield wanted(values)
