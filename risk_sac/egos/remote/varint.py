"""Numbers without a fraction as protocol buffers write them: seven bits to a byte, the lowest first.

Source: protobuf.dev, "Encoding".
"""

LONGEST = 70  # bits


def varint(value: int) -> bytes:
    """A number of up to 64 bits; a negative one as its complement."""
    if 0 <= value < 128:
        return bytes((value,))
    groups = []
    value &= (1 << 64) - 1
    while value > 127:
        groups.append(value & 127 | 128)
        value >>= 7
    return bytes((*groups, value))


def read_varint(data: bytes, at: int) -> tuple[int, int]:
    """The number that begins there, and where it has ended.

    Raises:
      IndexError: the bytes end before.
      ValueError: it is longer than any number.
    """
    value = data[at]
    if value < 128:  # as nearly all are
        return value, at + 1
    value = shift = 0
    while shift < LONGEST:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7
    raise ValueError("a number of more than 64 bits")


def varints(data: bytes) -> list[int]:
    """Numbers, one after the other."""
    values, at = [], 0
    while at < len(data):
        value, at = read_varint(data, at)
        values.append(value)
    return values
