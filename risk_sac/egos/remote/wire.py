"""Messages of a `.proto` of this folder as bytes, in protocol buffers' wire format; the schema is read from that file.

Choice: no protobuf package. Other packages pin versions of it (commonroad-io one that is pure Python, with which a step
takes half a millisecond more), and all that is needed of it is what follows. Rows of numbers are numpy's.

Source: protobuf.dev, "Encoding".
"""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from risk_sac.egos.remote.varint import read_varint, varint, varints

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5  # wire types
DOUBLE = struct.Struct("<d")

Message = Mapping[str, Any]
"""Field -> value; a field that was not told is absent if it is a message, else 0, empty or an empty list."""


class Field(NamedTuple):
    """A field of a message."""

    name: str
    number: int
    type: str  # double, string, a message's name; else a number without a fraction
    repeated: bool
    key: bytes  # that it begins with


class Schema(dict[str, tuple[Field, ...]]):
    """Message -> its fields; and what reading one takes, made ready, for it is done in each step.

    Attributes:
      numbered: message -> number -> field.
      untold: message -> name of each field, whether it is repeated, and what it is where nothing was told; without
        single messages, which are absent then.
    """

    def __init__(self, messages: Mapping[str, Sequence[Field]]) -> None:
        super().__init__({name: tuple(fields) for name, fields in messages.items()})
        self.numbered = {name: {field.number: field for field in fields} for name, fields in self.items()}
        nothing: Mapping[str, Any] = {"double": 0.0, "string": ""}
        self.untold = {
            name: [(f.name, f.repeated, nothing.get(f.type, 0)) for f in fields if f.repeated or f.type not in self]
            for name, fields in self.items()
        }


def read_schema(file: str) -> Schema:
    """The messages of a file of this folder, in which each field has a line of its own."""
    found: dict[str, list[tuple[str, int, str, bool]]] = {}
    fields: list[tuple[str, int, str, bool]] = []
    for line in (files(__package__) / file).read_text(encoding="utf-8").splitlines():
        if begins := re.match(r"message (\w+)", line):
            fields = found[begins[1]] = []
        elif field := re.match(r"\s+(repeated )?(\w+) (\w+) = (\d+);", line):
            fields.append((field[3], int(field[4]), field[2], bool(field[1])))
    wires = {"double": FIXED64, "string": BYTES} | dict.fromkeys(found, BYTES)

    def made(name: str, number: int, type_: str, repeated: bool) -> Field:
        wire = BYTES if repeated else wires.get(type_, VARINT)
        return Field(name, number, type_, repeated, varint(number << 3 | wire))

    return Schema({name: [made(*each) for each in told] for name, told in found.items()})


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
        if field.type == "double":
            if field.repeated:
                parts.append(_told(field, np.asarray(value, dtype="<f8").tobytes()))
            else:
                parts.append(field.key + DOUBLE.pack(value))
        elif field.type == "string":
            parts += [_told(field, each.encode()) for each in (value if field.repeated else (value,))]
        elif field.type in schema:
            every = value if field.repeated else (value,)
            parts += [_told(field, encode(field.type, each, schema)) for each in every]
        elif field.repeated:
            parts.append(_told(field, b"".join(map(varint, value))))
        else:
            parts.append(field.key + varint(value))
    return b"".join(parts)


def decode(name: str, data: bytes, schema: Schema = SCHEMA) -> dict[str, Any]:
    """A message from bytes; fields of a later version are passed over.

    Raises:
      ValueError: these bytes are none of such a message's.
    """
    fields = schema.numbered[name]
    message: dict[str, Any] = {each: [] if repeated else nothing for each, repeated, nothing in schema.untold[name]}
    try:
        for number, wire, value in _parts(data):
            field = fields.get(number)
            if field is not None:
                message[field.name] = _value(field, wire, value, message.get(field.name), schema)
    except (AttributeError, IndexError, struct.error, TypeError, UnicodeDecodeError) as error:
        raise ValueError(f"{len(data)} bytes that are no {name}") from error
    return message


def _parts(data: bytes) -> Iterator[tuple[int, int, Any]]:
    """Number, wire type and raw value of each part."""
    at = 0
    while at < len(data):
        key, at = read_varint(data, at)
        number, wire = key >> 3, key & 7
        value: int | bytes
        if wire == VARINT:
            value, at = read_varint(data, at)
        elif wire in (FIXED64, FIXED32):
            length = 8 if wire == FIXED64 else 4
            value, at = data[at : at + length], at + length
        elif wire == BYTES:
            length, at = read_varint(data, at)
            value, at = data[at : at + length], at + length
        else:
            raise ValueError(f"wire type {wire}; wanted one of protocol buffers 3")
        if at > len(data):
            raise ValueError("a part that is cut off")
        yield number, wire, value


def _value(field: Field, wire: int, value: Any, before: Any, schema: Schema) -> Any:
    """What a part says of its field; to a repeated one it adds."""
    found: Any
    if field.type == "double":
        if not field.repeated:
            return (
                DOUBLE.unpack(value)[0] if len(value) == DOUBLE.size else np.frombuffer(value, dtype="<f8").tolist()[0]
            )
        before += np.frombuffer(value, dtype="<f8").tolist()
        return before
    if field.type == "string":
        found = value.decode()
    elif field.type in schema:
        found = decode(field.type, value, schema)
    elif not field.repeated:
        return value + 0
    elif wire != VARINT:
        before += varints(value)
        return before
    else:
        found = value
    if not field.repeated:
        return found
    before.append(found)
    return before


def _told(field: Field, data: bytes) -> bytes:
    return field.key + varint(len(data)) + data
