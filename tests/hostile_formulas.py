"""STL formulas that cost time or memory or are ambiguous; fixed set."""

import itertools
from collections.abc import Iterator

from risk_sac.risk.requirements import SIGNALS

LONGEST = 500  # characters that a requirement may have
P, Q = "ttc_s >= 1", "vehicle_gap_m <= 10"
NUMBERS = (
    "1e999", "-1e999", "1e308", "1e-308", "1e-400", "NaN", "nan", "inf", "-inf", "Infinity", "0x10", "0b1", "1_000",
    "1e", "1e+", ".", "..", "1..2", "--1", "+1", "9" * 400, "0." + "0" * 400 + "1", "1e0000000000000000000009", "١٢",
    "½", "²", "1,5", "1'000", "1j", "00", "1e9", "1000000001", "$1", "%s", "{0}", "\\x31",
)  # fmt: skip
BOUNDS = (
    "0,1e999", "0,1e9", "0,999999", "0,1000000", "0,9999999999", "-1,1", "-5,-1", "5,1", "1,1", "0,0", "0,0.05",
    "0,0.1s", "0,1ms", "0,1us", "0,1ns", "0,1h", "0,", ",1", "", "0", "0 1", "0;1", "0,1,2", "a,b", "ttc_s,1",
    "NaN,1", "0,NaN", "0,inf", "inf,inf", "-inf,0", "0x0,0x1", "1e0,1e1", "0.1,0.30000000000000004", "0,20",
    "19.9,20", "0,20.1", "20,20", "0,20000ms", "999999,999999", "0.000001,0.000002", "0,½", "0,١", "(0,1)", "[0,1]",
    "0,1]0,1", "0:1", "0:1:2", "0,+1", "0,--1", "0,1e-1",
)  # fmt: skip
FUTURE = (
    "always", "eventually", "until", "unless", "next", "G", "F", "U", "W", "X", "s_next", "sX", "release", "R",
    "finally",
)  # fmt: skip
UNKNOWN = (
    "speed", "TTC_S", "ttc_s_", "_ttc_s", "__class__", "__import__", "self", "exec", "lambda", "None", "True", "true",
    "false", "ttc", "ego.speed", "ego[0]", "os.system", "x" * 450, "а", "ttс_s", "тtc_s", "𝑡𝑡𝑐_𝑠", "ttc\u200b_s",
    "ttc\u00ads", "i̇",
)  # fmt: skip
OPERATORS = (
    "==", "!=", "=", "===", "<>", "><", "=>", "=<", "<=>", "<->", "iff", "xor", "^", "**", "//", "%", "@", ":=",
    "&&&", "|||", "~", "¬", "∧", "∨", "→", "≤", "≥", "<<", ">>", "+=", "->->", "<-", "!", "not not", ",", ";",
)  # fmt: skip
INJECTIONS = (
    "__import__('os').system('touch /tmp/evil')", "{0.__class__.__mro__}", "${HOME}", "$(id)", "`id`",
    "'; DROP TABLE run; --", "ttc_s >= 1; import os", "ttc_s >= 1\nimport os", "ttc_s >= 1 # comment",
    "ttc_s >= 1 // comment", "/* c */ ttc_s >= 1", "specification x", "const float c = 1", "input float ttc_s",
    "output float y", "y = ttc_s >= 1", "import x", "from x import y", "@ topic(ttc_s, a)", "@topic(a,b)",
    "out = always(ttc_s >= 1)", "ttc_s >= 1 }", "{ ttc_s >= 1 }", "assertion1 = ttc_s >= 1", "eval(ttc_s)",
    "ttc_s.__class__ >= 1", "ttc_s['x'] >= 1", "ttc_s if True else 1", "lambda: ttc_s", "[x for x in ttc_s]",
    "ttc_s >= (1).__class__", "ttc_s >= open('/etc/passwd')", "<script>alert(1)</script>", "%00", "%n%n%n%n",
    "../../etc/passwd", "ttc_s >= 1 && rm -rf /", "float ttc_s", "unit: ms ttc_s >= 1", "ttc_s >= 1 with tolerance",
    "\\u0074tc_s >= 1",
)  # fmt: skip


def formulas() -> list[str]:
    """All of them, each once."""
    parts = (_texts, _numbers, _bounds, _words, _nested, _unbalanced, _windows, _sums, _repeated)
    return list(dict.fromkeys(itertools.chain.from_iterable(part() for part in parts)))


def _texts() -> Iterator[str]:
    """Characters that no formula has."""
    yield from INJECTIONS
    for code in (*range(1, 33), 127, 133, 160, 0x2028, 0x202E, 0xFEFF, 0xFFFD, 0xFFFE, 0x1F600, 0x10FFFF):
        yield f"ttc_s{chr(code)}>= 1"
        yield f"ttc{chr(code)}_s >= 1"
    yield from (character * 500 for character in " \t\n,é𐀀")
    yield from ("\0", "\ud800", "é̂̃̄" * 100, "()" * 250, "[]" * 250, "x" * 501, "a" * 10_000, "(" * 100_000)
    yield from (P + " " * 400, P * 100, P + ")" * 400, f"{P} and " * 1000)


def _numbers() -> Iterator[str]:
    """Numbers that are none, that are too large, and that only meet."""
    for number in NUMBERS:
        yield f"ttc_s >= {number}"
        yield f"ttc_s * {number} >= {number} * {number}"
        yield f"ttc_s / {number} >= 1"
    yield from (f"ttc_s / {divisor} >= 1" for divisor in ("0", "0.0", "-1", "(1 - 1)"))
    yield from ("1 / ttc_s >= 1", "0 / 0 >= 0")
    yield from ("*".join(["ego_speed_mps"] * n) + " >= 1" for n in range(2, 12))
    yield from ("1e9 * " * n + "0 >= ttc_s" for n in range(1, 9))


def _bounds() -> Iterator[str]:
    """Windows that are invalid, endless, or end before they begin."""
    for bound in BOUNDS:
        yield f"historically[{bound}]({P})"
        yield f"({P}) since[{bound}] ({Q})"
        yield f"once[{bound}] once[{bound}] {P}"


def _words() -> Iterator[str]:
    """Signals, operators and futures that there are not."""
    for word in FUTURE:
        yield from (f"{word}({P})", f"{word}[0,1]({P})", f"({P}) {word} ({Q})", f"({P}) {word}[0,1] ({Q})")
    for word in UNKNOWN:
        yield from (f"{word} >= 1", f"{P} and {word} >= 1", word)
    for operator in OPERATORS:
        yield from (f"ttc_s {operator} 1", f"{P} {operator} {Q}", f"{operator} ttc_s >= 1")


def _nested() -> Iterator[str]:
    """Towers, just below and above what is allowed, of all that nests."""
    for depth in (10, 20, 37, 38, 39, 40, 41, 60, 100, 120):
        yield "(" * depth + P + ")" * depth
        yield "not " * depth + P
        yield "!" * depth + P
        yield "prev " * depth + P
        yield "-" * depth + "ttc_s >= 1"
        yield "abs(" * depth + "ttc_s" + ")" * depth + " >= 1"
        yield "once " * depth + P
        yield "H[0,0.1]" * depth + P
        yield " -> ".join(["1>0"] * depth)
        yield "+".join(["1"] * depth) + " >= ttc_s"
        yield " or ".join(["1>0"] * depth)
        yield "(1>0 since " * depth + P + ")" * depth
        yield "!(" * depth + P + ")" * depth
        yield "-(" * depth + "ttc_s" + ")" * depth + ">=1"


def _unbalanced() -> Iterator[str]:
    """A good formula with one character taken away, put in, or turned."""
    good = f"historically[0,0.5]({P}) implies not (once[0.1,1] {Q} or abs(ttc_s - 2) * 3 < 4)"
    for at in range(len(good)):
        yield good[:at] + good[at + 1 :]
        yield good[:at] + "()[],-<>&|e1\x00\u0435"[at % 14] + good[at:]
    yield from (good[:end] for end in range(1, len(good), 2))


def _windows() -> Iterator[str]:
    """The most work that is let through, and a little more."""
    for last in (1, 2, 5, 7, 9, 9.9, 10, 10.1, 12, 15, 19.9, 20):
        yield f"({P}) since[0,{last}] ({Q})"
        yield f"historically[0,{last}](ttc_s >= 1 or once[0,{round(20 - last, 1)}] {Q})"
        yield f"({P}) since[{last},20] ({Q})"
    for count in (2, 5, 10, 15, 20, 25, 30):
        each = round(20 / count, 1)
        yield f"H[0,{each}]" * count + P
        yield " and ".join(f"H[0,20]ttc_s>{i}" for i in range(count))
        yield " and ".join(f"O[0,{20 - i / 10:.1f}]ttc_s>1" for i in range(count))
        yield " or ".join(f"(ttc_s>{i} S[0,{round(9.9 / count**0.5, 1)}] 1>0)" for i in range(count))
        yield " and ".join(f"(ttc_s>{i} S 1>0)" for i in range(count))
        yield f"(1>0 S[0,{each}]" * count + P + ")" * count


def _sums() -> Iterator[str]:
    """Long formulas without any window."""
    names = list(SIGNALS)
    for count in (5, 10, 20, 30, 38, 45):
        yield "+".join(names[i % len(names)] for i in range(count)) + " >= 1"
        yield " and ".join(f"{names[i % len(names)]}>{i}" for i in range(count))
        yield "*".join(["1"] * count) + ">=ttc_s"
        yield ">".join(["ttc_s"] * count)


def _repeated() -> Iterator[str]:
    """One timed sub-formula many times, in all company."""
    timed = "once[0,2](ttc_s<1)"
    for count in (2, 3, 5, 10, 15, 20, 24):
        for operator in (" and ", " or ", " -> ", " S "):
            yield operator.join([timed] * count)
        yield "not " * count + timed
        yield f"H[0,1]({timed}) and " * count + timed
