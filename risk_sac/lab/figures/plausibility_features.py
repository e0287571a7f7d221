"""Draws the histogram of every plausibility feature: undisturbed scenes beside the failures of runs.

    python -m risk_sac.lab.figures.plausibility_features UNDISTURBED FILE.png RUN...

UNDISTURBED is the folder of `risk_sac.lab.figures.undisturbed_behaviour`; RUN are folders of finished runs.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from risk_sac.host.canvas import canvas
from risk_sac.risk.driving import FEATURES
from risk_sac.run_folder.results import read_results

BINS, COLUMNS = 30, 4


def undisturbed_values(folder: Path) -> Mapping[str, Sequence[float]]:
    """Collects the values of each feature in undisturbed scenes."""
    return _by_feature(
        (name, value)
        for file in sorted(folder.glob("*.jsonl"))
        for line in file.read_text().splitlines()
        for _, name, value, _ in json.loads(line)["observed"]
    )


def failing_values(folders: Sequence[Path]) -> Mapping[str, Sequence[float]]:
    """Collects the least likely values of each feature and adversary in the valid violations of runs."""
    return _by_feature(
        (fact.feature, fact.value)
        for folder in folders
        for failure in read_results(folder).failures
        for violation in failure.episode.valid_violations
        if violation.behaviour is not None
        for fact in violation.behaviour.facts
    )


def draw(undisturbed: Mapping[str, Sequence[float]], failing: Mapping[str, Sequence[float]], file: Path) -> None:
    """Draws a panel per feature, each histogram to its own share."""
    rows = -(-len(FEATURES) // COLUMNS)
    figure = canvas((4.0 * COLUMNS, 2.4 * rows))
    for place, feature in enumerate(FEATURES.values(), start=1):
        axis = figure.add_subplot(rows, COLUMNS, place)
        samples = {"undisturbed": undisturbed.get(feature.name, []), "failures": failing.get(feature.name, [])}
        every = [value for sample in samples.values() for value in sample]
        axis.set_title(f"{feature.name}, {feature.unit}{'' if feature.published else ' (not published)'}", fontsize=9)
        if every:
            edges = np.linspace(min(every), max(every) + 1e-9, BINS + 1)
            for name, sample in samples.items():
                shares = np.full(len(sample), 1.0 / max(1, len(sample)))
                axis.hist(sample, edges.tolist(), weights=shares, alpha=0.5, label=f"{name} ({len(sample)})")
            axis.set_yscale("log")
            axis.legend(fontsize=7)
    figure.savefig(file, dpi=80)


def _by_feature(pairs: Iterator[tuple[str, float]]) -> Mapping[str, Sequence[float]]:
    found: dict[str, list[float]] = defaultdict(list)
    for name, value in pairs:
        found[name].append(value)
    return found


def main() -> None:
    """Draws the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("undisturbed", type=Path)
    parser.add_argument("file", type=Path)
    parser.add_argument("runs", type=Path, nargs="+")
    options = parser.parse_args()
    draw(undisturbed_values(options.undisturbed), failing_values(options.runs), options.file)


if __name__ == "__main__":
    main()
