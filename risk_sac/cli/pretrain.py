"""`risk-sac pretrain`: plays script episodes before the training egos, and fits the prior of each family to them."""

import argparse
import multiprocessing
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from rich.progress import Progress

from risk_sac.cli.console import OK, number, say
from risk_sac.cli.parser import Commands, add_command
from risk_sac.config import SHIPPED
from risk_sac.machine import cores
from risk_sac.terminal import console


def add(commands: Commands) -> None:
    """Adds the command."""
    parser = add_command(
        commands,
        "pretrain",
        _pretrain,
        "play scripts before many egos and learn which script fits which scene",
        more="The same command again goes on with an interrupted one. It writes DIR/<family>.npz for each family.",
        example="pretrain --families low --streams 2 --chunks 4 --out results/prior",
    )
    parser.add_argument("--families", nargs="+", choices=SHIPPED, default=list(SHIPPED), metavar="NAME")
    streams = "independent sequences of episodes for each family (default: %(default)s)"
    parser.add_argument("--streams", type=number(int, 1, 100), default=4, metavar="N", help=streams)
    chunks = "chunks of 250 episodes in each stream (default: %(default)s)"
    parser.add_argument("--chunks", type=number(int, 1, 10_000), default=50, metavar="N", help=chunks)
    parser.add_argument("--seed", type=number(int, 0), default=0, metavar="S", help="(default: %(default)s)")
    jobs = "processes that play at a time (default: one per core)"
    parser.add_argument("--jobs", type=number(int, 1, 1000), metavar="N", help=jobs)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="for episodes and priors")


def _pretrain(options: argparse.Namespace) -> int:
    # Here, because loading torch and the simulator takes seconds.
    from risk_sac.pretraining.episodes import play_stream
    from risk_sac.pretraining.fit import Dataset, fitted_prior
    from risk_sac.prior.shipped import write_prior

    episodes: Path = options.out / "episodes"
    episodes.mkdir(parents=True, exist_ok=True)
    wanted = [(family, options.seed, k) for k in range(options.streams) for family in options.families]
    with (
        ProcessPoolExecutor(options.jobs or cores(), multiprocessing.get_context("spawn")) as pool,
        Progress(console=console) as bar,
    ):
        task = bar.add_task("streams", total=len(wanted))
        for ended in as_completed([pool.submit(play_stream, *each, episodes, options.chunks) for each in wanted]):
            ended.result()
            bar.advance(task)
    for family in options.families:
        prior = fitted_prior(family, Dataset.read(episodes, family), options.seed)
        write_prior(options.out / f"{family}.npz", prior)
        say(f"{family}: {prior.card['episodes']} episodes, AUC of failing {prior.card['auc_fails']:.2f}")
    return OK
