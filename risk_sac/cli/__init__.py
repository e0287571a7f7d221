"""Entry point `risk-sac` and its commands."""

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from risk_sac import __version__
from risk_sac.cli.console import FAILED, INTERRUPTED, MISUSED
from risk_sac.cli.parser import Commands, Parser, add_command, as_typed, example_text, wrong_path
from risk_sac.egos import registry
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.host.terminal import complain, run_command
from risk_sac.scenario import library

ARENAS = {"MALLOC_ARENA_MAX": "2"}  # glibc gives each thread an arena otherwise, and the server's memory grows


def add_service_commands(commands: Commands) -> None:
    """Adds the commands."""
    serve = add_command(
        commands, "serve", _serve, "run the service and its web page in the foreground", example="serve --runs runs"
    )
    network = serve.group("network")
    network.add_argument("--host", metavar="ADDRESS", help="(default: 127.0.0.1)")
    network.add_argument("--port", type=int, help="(default: 8000)")
    network.add_argument("--root-path", metavar="PATH", help="path of the service behind a proxy, such as /sim")
    data = serve.group("data")
    data.add_argument("--data-dir", type=Path, metavar="DIR", help="(default: data)")
    runs = "show the runs in this folder, which `run` or `evaluate` wrote; they are copied"
    data.add_argument("--runs", type=Path, metavar="DIR", help=runs)

    keys = commands.add_parser(
        "keys", help="create, list and revoke the service's API keys", add_help=False, prefix_chars="\0"
    )
    keys.set_defaults(command=_keys)
    keys.add_argument("rest", nargs="*")


def _serve(options: argparse.Namespace) -> int:
    """Replaces this process: the method's code never imports the service."""
    given = {"HOST": options.host, "PORT": options.port, "ROOT_PATH": options.root_path}
    given |= {"DATA_DIR": options.data_dir, "RUNS": options.runs}
    settings = {f"RISK_SAC_{name}": str(value) for name, value in given.items() if value is not None}
    os.execve(sys.executable, [sys.executable, "-m", "service"], ARENAS | os.environ | settings)


def _keys(options: argparse.Namespace) -> int:
    """Replaces this process: the method's code never imports the service."""
    os.execv(sys.executable, [sys.executable, "-m", "service.keys", *options.rest])


COMMANDS = {  # What adds commands, and their names: a command loads no module of another one.
    "run.add": ("run", "evaluate"),
    "scenarios.add": ("scenarios",),
    "scenarios.add_places": ("places",),
    "egos.add": ("egos",),
    "show.add": ("show",),
    "replay.add": ("bundle", "replay", "verify"),
    "replay.add_understand": ("minimise", "region", "clusters"),
    "replay.add_export": ("export",),
    "regress.add": ("regress",),
    "report.add_grid": ("grid",),
    "rate.add_rate": ("rate",),
    "rate.add_boundary": ("boundary",),
    "report.add_trend": ("trend",),
    "report.add_report": ("report", "coverage"),
    "lab.add_benchmark": ("benchmark", "power"),
    "lab.add_pretrain": ("pretrain",),
    "add_service_commands": ("serve", "keys"),
    "campaigns.add": ("campaigns",),
}
EPILOG = """exit status:
  0    done
  1    failed
  2    a setting or an argument is wrong
  130  interrupted; the same command continues
`risk-sac campaigns --help` has the exit status of its commands."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    return run_command(lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> int:
    arguments = sys.argv[1:] if arguments is None else arguments
    options, unknown = _parser(arguments).parse_known_args(arguments)
    if unknown:
        options.parser.refuse(unknown)
    options.typed = shlex.join(["risk-sac", *arguments])
    try:
        _make_absolute(options)
        status: int = options.command(options)
    except ConfigError as error:
        complain("\n".join(as_typed(each, options) for each in (error, *error.others)))
        return MISUSED
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    except OSError as error:
        if wrong := wrong_path(error, options):
            complain(str(wrong))
            return MISUSED
        where = error.filename or vars(options).get("out") or ""
        complain(f"{where}: {error.strerror or error}".removeprefix(": "))
        status = options.on_error
    except (RiskSacError, MemoryError) as error:
        complain(str(error) or "there is too little memory")
        status = options.on_error
    except SystemExit:  # no command ends so
        complain("code that a command has loaded ended the program; what was done until then is kept")
        status = options.on_error or FAILED
    return status


def _make_absolute(options: argparse.Namespace) -> None:
    """Makes paths absolute, in variables too: egos may change the working directory."""
    for name, value in vars(options).items():
        if isinstance(value, Path):
            setattr(options, name, value.absolute())
        elif isinstance(value, list):
            setattr(options, name, [each.absolute() if isinstance(each, Path) else each for each in value])
    for name in (registry.FILE, library.VARIABLE):
        if os.environ.get(name):
            os.environ[name] = os.path.abspath(os.environ[name])


def _parser(arguments: Sequence[str] = ()) -> argparse.ArgumentParser:
    parser = Parser(
        prog="risk-sac",
        description="Finds scenes and adversaries that make an automated vehicle, the ego, fail.",
        epilog=example_text("run --scenario low --method archive --episodes 100 --out runs/low", EPILOG),
    )
    parser.add_argument("--version", action="version", version=f"risk-sac {__version__}")
    parser.set_defaults(on_error=FAILED)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    asked = [adder for adder, names in COMMANDS.items() if arguments and arguments[0] in names]
    for adder in asked or COMMANDS:
        module, _, function = adder.rpartition(".")
        getattr(import_module(f"{__name__}.{module}" if module else __name__), function)(commands)
    return parser
