"""Writes Parquet: a row per episode; columns are the records' fields.

A record within a record is a struct, and a mapping is a map.
"""

import io
import types
from collections import Counter
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import pyarrow as pa
from pyarrow import parquet
from pydantic import BaseModel

from risk_sac.errors import ConfigError
from risk_sac.failures.export.formats import Files
from risk_sac.metrics import results_digest
from risk_sac.records import Collision, EpisodeRecord, Outcome
from risk_sac.run_folder.results import EPISODES, RunResults, read_results, read_verified, records_from_lines

NAME = "episodes.parquet"
OF_THE_RUN = [pa.field(name, pa.string(), nullable=False) for name in ("id", "run_id", "family", "method", "ego")]
SEED = pa.field("run_seed", pa.int64(), nullable=False)
SPECS = b"risk_sac.specs"  # key of the file's metadata: a JSON object from run to its spec
OF_THE_VERDICT = [
    pa.field("plausibility", pa.string()),
    pa.field("severity", pa.string()),
    pa.field("injury_risk", pa.float64()),
    pa.field("fault", pa.string()),
    pa.field("prevented_by", pa.list_(pa.string())),
]
SCALARS: Mapping[Any, pa.DataType] = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}


def files(runs: Sequence[Path]) -> Files:
    """Returns a file, a row group per run; `ConfigError` for other folders.

    Two runs that differ in their specs and share an id get the digest of their specs behind it.
    """
    results: dict[str, tuple[Path, RunResults]] = {}
    for folder in runs:
        found = read_results(folder)
        if found.finished or found.spec.digest not in results:  # the same spec gives the same rows
            results[found.spec.digest] = folder, found
    shared = Counter(each.spec.id for _, each in results.values())
    ids = {
        digest: each.spec.id if shared[each.spec.id] == 1 else f"{each.spec.id}-{digest[:8]}"
        for digest, (_, each) in results.items()
    }
    specs = ", ".join(f'"{ids[digest]}": {each.spec.model_dump_json()}' for digest, (_, each) in results.items())
    schema = pa.schema(
        [*OF_THE_RUN, SEED, *OF_THE_VERDICT, *_type(EpisodeRecord)], metadata={SPECS: f"{{{specs}}}".encode()}
    )
    content = io.BytesIO()
    with parquet.ParquetWriter(content, schema, compression="zstd") as writer:
        for digest, (folder, each) in results.items():
            if rows := _rows(folder, each, ids[digest]):
                writer.write_table(pa.Table.from_pylist(rows, schema))
    return {NAME: content.getvalue()}


def _rows(folder: Path, results: RunResults, id_: str) -> list[dict[str, Any]]:
    """Returns a run's rows; refuses failures that did not repeat."""
    file = folder / EPISODES
    try:
        records = tuple(records_from_lines(file.read_bytes()))
    except (OSError, ValueError) as error:
        raise ConfigError("RESULTS", f"{file} was not written by a run: {error}") from error
    if results.finished and results_digest(records) != results.digest:
        raise ConfigError("RESULTS", f"{file} holds other episodes than its digest was formed over")
    spec = results.spec
    verified = read_verified(folder, results.digest or "")
    run = {
        "run_id": id_,
        "family": spec.family,
        "method": spec.method,
        "run_seed": spec.seed,
        "ego": spec.ego.model_dump_json(),
    }
    return [
        {"id": record.id_in(id_), **run, **_verdict(record), **record.model_dump()}
        for record in (verified.judged(records) if verified else records)
    ]


def _verdict(record: EpisodeRecord) -> dict[str, Any]:
    """Returns a failure's plausibility, severity, fault and prevention; otherwise empty."""
    worst = record.worst_violation if record.outcome is Outcome.FAILURE else None
    if worst is None:
        return {}
    judged = worst.judgement if isinstance(worst, Collision) else None
    return {
        "plausibility": worst.behaviour and worst.behaviour.verdict,
        "severity": judged and judged.severity,
        "injury_risk": judged and judged.injury_risk,
        "fault": worst.blamed,
        "prevented_by": [name for name, prevents in worst.prevention.items() if prevents],
    }


def _type(annotation: Any) -> pa.DataType:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _type(arguments[0])
    if origin in (Union, types.UnionType):
        return _type(next(each for each in arguments if each is not type(None)))
    if origin is Literal:
        return pa.string()
    if origin is tuple:
        return pa.list_(_type(arguments[0]))
    if origin is not None and issubclass(origin, Mapping):
        return pa.map_(_type(arguments[0]), _type(arguments[1]))
    if issubclass(annotation, BaseModel):
        fields = annotation.model_fields.items()
        return pa.struct([pa.field(each.serialization_alias or name, _type(each.annotation)) for name, each in fields])
    if issubclass(annotation, Enum):
        return pa.string()
    return SCALARS[annotation]
