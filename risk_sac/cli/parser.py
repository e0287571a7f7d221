"""Argument parser of all commands: grouped flags, examples, errors with suggestions."""

import argparse
import re
import sys
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from risk_sac.cli.console import MISUSED
from risk_sac.config import CampaignSpec
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.host.terminal import complain

WIDTH = 78
FLAG = re.compile(r"--[a-z][\w-]*")
RESULTS_HELP = "folder of a run, or its results.json"
SCENARIO_FLAG = "--scenario"  # for the fields `family` and `families`
FAILURE_HELP = "id of a failure, or the number at its end"

Commands: TypeAlias = "argparse._SubParsersAction[Parser]"
"""Where a group of commands adds its parsers."""


class _Help(argparse.RawDescriptionHelpFormatter):
    """Help whose lines break only at spaces, not within hyphenated names."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        return textwrap.wrap(" ".join(text.split()), width, break_on_hyphens=False)


class Parser(argparse.ArgumentParser):
    """Parser with titled flag groups; errors name the closest known name."""

    def __init__(self, *args: Any, **options: Any) -> None:
        options["formatter_class"] = _Help
        super().__init__(*args, **options)
        self._titled: dict[str, argparse._ArgumentGroup] = {}

    def group(self, title: str) -> "argparse._ArgumentGroup":
        """Returns the group of flags with a title; adds a new one."""
        if title not in self._titled:
            self._titled[title] = self.add_argument_group(title)
        return self._titled[title]

    def flags(self) -> list[str]:
        """Returns the names of all flags."""
        return re.findall(rf"(?<![\w-]){FLAG.pattern}", self.format_usage())

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Overrides argparse: an unknown flag is refused before a missing one."""
        words = list(sys.argv[1:] if args is None else args)
        if self.get_default("command") is not None and "-" in self.prefix_chars:  # `keys` passes its words on
            taken = words[: words.index("--")] if "--" in words else words
            names = (word.partition("=")[0] for word in taken)
            known = (*self.flags(), "--help")  # argparse takes a unique beginning of a flag too
            unknown = [
                name for name in names if FLAG.fullmatch(name) and not any(each.startswith(name) for each in known)
            ]
            if unknown:
                self.refuse(unknown)
        parsed: tuple[Any, list[str]] = super().parse_known_args(words, namespace)
        return parsed

    def refuse(self, unknown: Sequence[str]) -> NoReturn:
        """Ends the program because of words that no flag or argument takes."""
        name = unknown[0].partition("=")[0]
        if not name.startswith("--"):
            self.error(f"{name!r} is one argument too many")
        hint, field = did_you_mean(name, self.flags()), name.removeprefix("--")
        if not hint and "--spec" in self.flags() and field in CampaignSpec.model_fields:
            hint = f"write {field} into a file and name it with --spec"
        self.error(f"there is no flag {name}" + _sentence(hint))

    def error(self, message: str) -> NoReturn:
        """Ends the program with a line on the error and a hint."""
        complain(f"{self.prog}: {message.removeprefix('argument ')}\n`{self.prog} --help` lists what it takes.")
        raise SystemExit(MISUSED)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Overrides argparse's message for a value that is none of the choices."""
        if action.choices is not None and value not in action.choices:
            known = [str(each) for each in action.choices]
            hint = did_you_mean(str(value), known) or f"choose {_listed(known)}"
            raise argparse.ArgumentError(action, f"there is no {str(value)!r}" + _sentence(hint))


def add_command(
    commands: Commands,
    name: str,
    run: Callable[[argparse.Namespace], int],
    summary: str,
    *,
    example: str,
    more: str = "",
    epilog: str = "",
) -> Parser:
    """Adds a command that `run` executes; returns its parser.

    Args:
      commands: the group it belongs to.
      name: as typed.
      run: takes the parsed options; returns the exit status.
      summary: one line for the list of commands, without a capital and without a full stop.
      example: a command line that works, without `risk-sac` in front.
      more: sentences that continue the summary in the command's own help.
      epilog: printed below the example, with its line breaks.
    """
    parser = add_group(commands, name, summary, example=example, more=more, epilog=epilog)
    parser.set_defaults(command=run, parser=parser)
    return parser


def add_group(commands: Commands, name: str, summary: str, *, example: str, more: str = "", epilog: str = "") -> Parser:
    """Adds a command with subcommands; arguments are those of `add_command`."""
    paragraph = textwrap.fill(f"{summary[0].upper()}{summary[1:]}. {more}".strip(), WIDTH)
    return commands.add_parser(name, help=summary, description=paragraph, epilog=example_text(example, epilog))


def example_text(example: str, epilog: str = "") -> str:
    """Returns a help text's end: the example and what follows it."""
    line = f"risk-sac {example}"
    lines = [line]
    if len(line) > WIDTH - 2:
        lines = textwrap.wrap(line, WIDTH - 6, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return "example:\n  " + " \\\n  ".join(lines) + (f"\n\n{epilog}" if epilog else "")


def add_failure_arguments(parser: Parser, default: str) -> None:
    """Adds the arguments that name a run and one of its failures."""
    parser.add_argument("results", type=Path, metavar="RESULTS", help=RESULTS_HELP)
    parser.add_argument("failure", nargs="?", metavar="FAILURE", help=f"{FAILURE_HELP}; {default}")


def add_json_flag(parser: Parser) -> None:
    """Adds the flag that `print_answer` reads."""
    parser.group("output").add_argument("--json", action="store_true", help="print one JSON document instead of tables")


def as_typed(error: ConfigError, options: argparse.Namespace) -> str:
    """Returns the message of a wrong setting, named by its flag.

    A flag that was not given, beside a file of settings, keeps the name of the field.
    """
    for part in reversed(re.split(r"[.\[]", error.field)) if ": " not in error.field else ():  # a path in a document
        given = vars(options).get(part.replace("-", "_"), "")
        flag = SCENARIO_FLAG if part in ("family", "families") else f"--{part}".replace("_", "-")
        if flag not in options.parser.flags():
            continue
        if given is None and vars(options).get("spec") is not None:
            break
        error.field = flag
        break
    if error.got != "nothing":
        return str(error)
    known = f"choose {error.expected}" if error.expected != "a value" else f"see `{options.parser.prog} --help`"
    return "; ".join(filter(None, [f"{error.field} is missing", known, error.remedy]))


def wrong_path(error: OSError, options: argparse.Namespace) -> ConfigError | None:
    """Returns the error of an argument's unreadable file.

    None for a file that no argument names.
    """
    named = {action.dest: action for action in options.parser._actions}
    for name, value in vars(options).items():
        values = value if isinstance(value, list) else [value]
        if name in named and error.filename is not None and str(error.filename) in map(str, values):
            action = named[name]
            field = next(iter(action.option_strings), str(action.metavar))
            got = f"{error.filename}, which cannot be read ({error.strerror})"
            return ConfigError(field, got, "an existing file or folder", "check its path")
    return None


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def _sentence(hint: str) -> str:
    return f"; {hint}" if hint else ""
