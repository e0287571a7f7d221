"""Messages of a `.proto` of this folder as bytes, in protocol buffers' wire format; the schema is read from that file.

Choice: no protobuf package. Other packages pin versions of it (commonroad-io one that is pure Python, with which a step
takes half a millisecond more), and all that is needed of it is what follows. Rows of numbers are numpy's.

Source: protobuf.dev, "Encoding".
"""

import re
import struct
from collections.abc import Iterator, Mapping
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5  # wire types
LONGEST_VARINT = 70  # bits

Message = Mapping[str, Any]
"""Field -> value; a field that was not told is absent if it is a message, else 0, empty or an empty list."""


class Field(NamedTuple):
    """A field of a message."""

    name: str
    number: int
    type: str  # double, string, a message's name; else a number without a fraction
    repeated: bool


Schema = Mapping[str, tuple[Field, ...]]
"""Message -> its fields."""


def read_schema(file: str) -> Schema:
    """The messages of a file of this folder, in which each field has a line of its own."""
    proto = (files(__package__) / file).read_text(encoding="utf-8")
    found: dict[str, list[Field]] = {}
    fields: list[Field] = []
    for line in proto.splitlines():
        if begins := re.match(r"message (\w+)", line):
            fields = found[begins[1]] = []
        elif field := re.match(r"\s+(repeated )?(\w+) (\w+) = (\d+);", line):
            fields.append(Field(field[3], int(field[4]), field[2], bool(field[1])))
    return {name: tuple(fields) for name, fields in found.items()}


SCHEMA = read_schema("ego.proto")


def encode(name: str, message: Message, schema: Schema = SCHEMA) -> bytes:
    """A message as bytes.

    Args:
      name: of its type.
      message: all of its fields; those that are None or left out are not told.
      schema: that has the type.
    """
    parts = []
    for field in schema[name]:
        value = message.get(field.name)
        if value is None:
            continue
        if field.type == "double" and field.repeated:
            parts.append(_told(field, np.asarray(value, dtype="<f8").tobytes()))
        elif field.type == "double":
            parts.append(_varint(field.number << 3 | FIXED64) + struct.pack("<d", value))
        elif field.type == "string":
            parts += [_told(field, each.encode()) for each in (value if field.repeated else (value,))]
        elif field.type in schema:
            parts += [
                _told(field, encode(field.type, each, schema)) for each in (value if field.repeated else (value,))
            ]
        elif field.repeated:
            parts.append(_told(field, b"".join(map(_varint, value))))
        else:
            parts.append(_varint(field.number << 3 | VARINT) + _varint(value))
    return b"".join(parts)


def decode(name: str, data: bytes, schema: Schema = SCHEMA) -> dict[str, Any]:
    """A message from bytes; fields of a later version are passed over.

    Raises:
      ValueError: these bytes are none of such a message's.
    """
    fields = {field.number: field for field in schema[name]}
    message = {field.name: _nothing(field) for field in schema[name] if field.repeated or field.type not in schema}
    try:
        for number, wire, value in _parts(data):
            field = fields.get(number)
            if field is not None:
                message[field.name] = _value(field, wire, value, message.get(field.name), schema)
    except (AttributeError, IndexError, struct.error, TypeError, UnicodeDecodeError) as error:
        raise ValueError(f"{len(data)} bytes that are no {name}") from error
    return message


def _nothing(field: Field) -> Any:
    if field.repeated:
        return []
    return {"double": 0.0, "string": ""}.get(field.type, 0)


def _parts(data: bytes) -> Iterator[tuple[int, int, Any]]:
    """Number, wire type and raw value of each part."""
    at = 0
    while at < len(data):
        key, at = _read_varint(data, at)
        number, wire = key >> 3, key & 7
        value: int | bytes
        if wire == VARINT:
            value, at = _read_varint(data, at)
        elif wire in (FIXED64, FIXED32):
            length = 8 if wire == FIXED64 else 4
            value, at = data[at : at + length], at + length
        elif wire == BYTES:
            length, at = _read_varint(data, at)
            value, at = data[at : at + length], at + length
        else:
            raise ValueError(f"wire type {wire}; wanted one of protocol buffers 3")
        if at > len(data):
            raise ValueError("a part that is cut off")
        yield number, wire, value


def _value(field: Field, wire: int, value: Any, before: Any, schema: Schema) -> Any:
    """What a part says of its field."""
    if field.type == "double":
        numbers = np.frombuffer(value, dtype="<f8").tolist()
        return [*before, *numbers] if field.repeated else numbers[0]
    if field.type == "string":
        return [*before, value.decode()] if field.repeated else value.decode()
    if field.type in schema:
        found = decode(field.type, value, schema)
        return [*before, found] if field.repeated else found
    if not field.repeated:
        return value + 0
    return [*before, value] if wire == VARINT else [*before, *_varints(value)]


def _told(field: Field, data: bytes) -> bytes:
    return _varint(field.number << 3 | BYTES) + _varint(len(data)) + data


def _varint(value: int) -> bytes:
    if 0 <= value < 128:
        return bytes((value,))
    groups = []
    value &= (1 << 64) - 1
    while value > 127:
        groups.append(value & 127 | 128)
        value >>= 7
    return bytes((*groups, value))


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while shift < LONGEST_VARINT:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7
    raise ValueError("a number of more than 64 bits")


def _varints(data: bytes) -> list[int]:
    values, at = [], 0
    while at < len(data):
        value, at = _read_varint(data, at)
        values.append(value)
    return values
