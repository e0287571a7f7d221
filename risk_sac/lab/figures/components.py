"""Studies whether shaping and RPER help, under one changed setting at a time.

    python -m risk_sac.lab.figures.components OUT [--scenario NAME ...] [--settings NAME ...] [--seeds N] [--episodes N]

plays `risk-sac`, its two ablations and `sac-lag`, which has neither, with the same λ and scenes. It plays what OUT
lacks, seeds outermost, and rewrites OUT/runs.csv after each run and OUT/table.md at the end. The seeds are for tuning:
no other result uses them.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from statistics import fmean

from risk_sac.config import Budget, LearnerConfig, MethodName, RunSpec
from risk_sac.execution.evaluate import run
from risk_sac.lab.figures.side_by_side import Row, rows_of
from risk_sac.metrics import bootstrap_interval
from risk_sac.records import DrivenBy
from risk_sac.report.statistics import holm, wilcoxon_p
from risk_sac.run_folder.results import EPISODES, RESULTS, read_results, records_from_lines
from risk_sac.scenario.reading import PAPER_FAMILIES

NEITHER: MethodName = "sac-lag"
WITH: Mapping[MethodName, str] = {
    "risk-sac": "both",
    "risk-sac-only-rs": "shaping",
    "risk-sac-only-rper": "RPER",
}
FIRST_SEED, RESAMPLING_SEED = 801, 1
COLD = {"warm_start": {"episodes": 0}}
SPARSE = {"reward": {"ttc_weight": 0.0, "rss_weight": 0.0}}
SETTINGS: Mapping[str, Mapping[str, Mapping[str, float | str]]] = {
    "as shipped": {},
    "no warm start": COLD,
    "sparse reward": SPARSE,
    "no warm start, sparse reward": {**COLD, **SPARSE},
    "Eq. 8 at terminal states": {"reward": {"zero_terminal_potential": False}},
    "a fifth of the updates": {"agent": {"updates_per_step": 0.04}},
    "batches of 32": {"agent": {"batch_size": 32}},
    "priority by return and robustness": {
        "replay": {"td_weight": 0.2, "return_weight": 1.0, "robustness_weight": 1.0, "priority_floor": 0.001}
    },
    "no importance weights": {"replay": {"correction": 0.0}},
    "weights for critics only": {"agent": {"weighted_actor": False}},
    "LAP's loss": {"agent": {"critic_loss": "huber"}, "replay": {"correction": 0.0}},
    "limit that binds": {"lagrangian": {"cost_limit": 0.05}},
}


def play(out: Path, played: tuple[str, RunSpec]) -> Row:
    """Plays a run unless OUT has it; returns its figures over the second half of its episodes."""
    setting, spec = played
    folder = out / setting.replace(" ", "-") / spec.id
    if not ((folder / RESULTS).exists() and read_results(folder).finished):
        run(spec, folder, lambda episodes, metrics: None)
    records = records_from_lines((folder / EPISODES).read_bytes())
    half = records[len(records) // 2 :]
    valid = [bool(record.valid_violations) for record in half]
    headline = [(worst := record.worst_violation) is not None and worst.headline_candidate for record in half]
    return {
        "setting": setting,
        "family": spec.family,
        "method": spec.method,
        "seed": spec.seed,
        "episodes": len(records),
        "policy": fmean(record.driven_by is DrivenBy.POLICY for record in half),
        "failing": fmean(valid),
        "headline": fmean(headline),
        "cost": fmean(record.mean_cost for record in half),
    }


def lines(rows: Sequence[Row]) -> Iterator[str]:
    """Yields a row per setting and component: the mean difference from neither."""
    yield "| setting | component | pairs | failing, of neither | difference (95 %) | p (Holm) | headline | cost |"
    yield "|---" * 8 + "|"
    rows_before_p, rows_after_p, p_values = list[str](), list[str](), list[float]()
    for setting, (method, component) in product(SETTINGS, WITH.items()):
        of = {(row["family"], row["seed"], row["method"]): row for row in rows if row["setting"] == setting}
        keys = [(family, seed) for family, seed, name in of if name == method and (family, seed, NEITHER) in of]
        pairs = [(of[*key, method], of[*key, NEITHER]) for key in keys]
        if len(pairs) < 2:
            continue
        failing, headline, cost = (
            [own[name] - other[name] for own, other in pairs] for name in ("failing", "headline", "cost")
        )
        low, high = bootstrap_interval(failing, RESAMPLING_SEED)
        baseline = fmean(other["failing"] for _, other in pairs)
        difference = f"{fmean(failing):+.2f} [{low:+.2f}, {high:+.2f}]"
        rows_before_p.append(f"| {setting} | {component} | {len(pairs)} | {baseline:.2f} | {difference} |")
        rows_after_p.append(f"| {fmean(headline):+.2f} | {fmean(cost):+.3f} |")
        p_values.append(wilcoxon_p(failing))
    for before, p, after in zip(rows_before_p, holm(p_values), rows_after_p, strict=True):
        yield f"{before} {p:.2g} {after}"


def main() -> None:
    """Plays what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scenario", dest="families", nargs="+", choices=PAPER_FAMILIES, default=["low", "mixed"])
    parser.add_argument("--settings", nargs="+", choices=SETTINGS, default=list(SETTINGS), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + options.seeds)
    runs = [
        (
            setting,
            RunSpec(
                family=family,
                method=method,
                seed=seed,
                budget=Budget(episodes=options.episodes),
                learner=LearnerConfig.model_validate(SETTINGS[setting]),
            ),
        )
        for seed, setting, family, method in product(seeds, options.settings, options.families, (NEITHER, *WITH))
    ]
    rows = rows_of(partial(play, options.out), runs, options.jobs, options.out / "runs.csv")
    text = "\n".join(lines(rows))
    (options.out / "table.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
