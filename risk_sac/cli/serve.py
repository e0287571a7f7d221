"""`risk-sac serve` and `keys`: the service in the foreground, and its API keys."""

import argparse
import os
import sys
from pathlib import Path

from risk_sac.cli.parser import Commands, add_command

ARENAS = {"MALLOC_ARENA_MAX": "2"}  # glibc gives each thread an arena otherwise, and the server's memory grows


def add(commands: Commands) -> None:
    """Adds the commands."""
    serve = add_command(
        commands,
        "serve",
        _serve,
        "run the service and its web page in the foreground",
        example="serve --runs runs",
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
