"""`risk-sac audit`: whether failures mean something."""

import argparse
import os
from pathlib import Path

from risk_sac.cli.console import OK, Board, Commands, console, progress_bar
from risk_sac.config import SHIPPED


def add_audit(commands: Commands) -> None:
    """Adds the command."""
    audit = commands.add_parser(
        "audit",
        help="controls beside the search: nobody attacks, chance attacks, better and worse egos; resumable",
    )
    audit.set_defaults(command=_audit)
    audit.add_argument("--families", nargs="+", choices=SHIPPED, default=list(SHIPPED))
    audit.add_argument("--episodes", type=int, default=400, metavar="N", help="of each ego (default: %(default)s)")
    audit.add_argument(
        "--idle-episodes", type=int, default=2000, metavar="N", help="with all actions 0 (default: %(default)s)"
    )
    audit.add_argument("--seed", type=int, default=51, metavar="N", help="(default: %(default)s)")
    audit.add_argument("--jobs", type=int, metavar="N", help="processes at a time (default: one per core)")
    audit.add_argument("--runs", type=Path, metavar="DIR", help="what `risk-sac evaluate --out DIR` left, to audit too")
    audit.add_argument("--out", type=Path, required=True, metavar="DIR", help="gets audit.md and the episodes")


def _audit(options: argparse.Namespace) -> int:
    from risk_sac.audit.controls import CONTROLS  # here, because loading the simulator takes a second
    from risk_sac.audit.run import parts_of, read, run
    from risk_sac.audit.table import markdown, searched

    parts = parts_of(options.families, options.episodes, options.idle_episodes)
    with progress_bar() as bar:
        board = Board(bar)
        run(
            parts,
            options.out / "episodes" / f"seed-{options.seed}",
            options.seed,
            options.jobs or os.cpu_count() or 1,
            lambda done, total: board.show(done, total, "", {}),
        )
    folder = options.out / "episodes" / f"seed-{options.seed}"
    controls = {
        (family, control.name): read(parts, folder, family, control)
        for family in options.families
        for control in CONTROLS
    }
    text = markdown(options.families, controls, searched(options.runs) if options.runs else ())
    (options.out / "audit.md").write_text(text, encoding="utf-8")
    console.print(text, markup=False, soft_wrap=True)
    console.print(f"Written: {options.out / 'audit.md'}")
    return OK
