"""Episode records as JSON, exactly and back."""

from pydantic import TypeAdapter

from risk_sac.records import EpisodeRecord

_RECORDS = TypeAdapter(list[EpisodeRecord])


def records_to_json(records: list[EpisodeRecord]) -> str:
    """Canonical JSON; floats keep every bit."""
    return _RECORDS.dump_json(records).decode()


def records_from_json(text: str) -> list[EpisodeRecord]:
    """The inverse of `records_to_json`."""
    return _RECORDS.validate_json(text)


def records_from_lines(content: bytes) -> list[EpisodeRecord]:
    """The records of an episodes.jsonl."""
    return [EpisodeRecord.model_validate_json(line) for line in content.splitlines()]
