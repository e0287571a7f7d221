"""The audit's tables: each figure with its interval, and each contact of the controls that should have none."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from risk_sac.audit.controls import CONTROLS, IDLE, LADDER, NOBODY
from risk_sac.audit.play import Played
from risk_sac.config import FamilyName
from risk_sac.metrics import wilson_interval
from risk_sac.records import Collision, ConflictType, EpisodeRecord
from risk_sac.run_folder.episode_json import records_from_lines
from risk_sac.run_folder.results import EPISODES, read_results
from risk_sac.verdicts.distinct import distinct_failures

Rows = list[list[str]]
Controls = Mapping[tuple[str, str], Sequence[Played]]  # by family and control


@dataclass(frozen=True, slots=True)
class Searched:
    """One run of a search."""

    family: FamilyName
    method: str
    records: Sequence[EpisodeRecord]

    @property
    def valid(self) -> list[Collision]:
        """Its valid failures."""
        return [c for record in self.records if (c := record.collision) is not None and c.valid]

    @property
    def contacts(self) -> list[Collision]:
        """All its contacts."""
        return [record.collision for record in self.records if record.collision is not None]


def searched(folder: Path) -> list[Searched]:
    """The runs that `risk-sac evaluate --out` left in a folder.

    Raises:
      ConfigError: one of them is damaged.
    """
    runs = []
    for run in sorted(folder.glob("runs/*/")):
        spec = read_results(run).spec
        runs.append(Searched(spec.family, spec.method, records_from_lines((run / EPISODES).read_bytes())))
    return runs


def markdown(families: Sequence[FamilyName], controls: Controls, runs: Sequence[Searched]) -> str:
    """The whole report."""
    parts = ["# Audit\n", _ladder(families, controls), _quiet(families, controls)]
    if runs:
        parts.append(_searches(runs))
        parts.append(_before_and_after(controls, runs))
    return "\n".join(parts)


def _ladder(families: Sequence[FamilyName], controls: Controls) -> str:
    head = ["family", "ego or control", "episodes", "rejected", "contacts", "artefacts", "valid (95 %)", "careful"]
    head.append("C_soft")
    rows: Rows = []
    for family in families:
        for control in CONTROLS:
            played = controls[family, control.name]
            hits = [p.collision for p in played if p.collision is not None]
            valid = [hit for hit in hits if hit.valid]
            low, high = wilson_interval(len(valid), len(played))
            steps = sum(p.steps for p in played)
            cost = sum(p.mean_cost * p.steps for p in played) / max(steps, 1)
            rows.append(
                [
                    family,
                    control.name,
                    str(len(played)),
                    str(sum(bool(p.rejected) for p in played)),
                    str(len(hits)),
                    str(sum(hit.artefact for hit in hits)),
                    f"{len(valid)} ({100 * low:.1f}-{100 * high:.1f} %)",
                    str(sum(hit.preventable for hit in hits)),
                    f"{cost:.3f}",
                ]
            )
    return f"## Controls and the ladder of egos under random search\n\n{_table(head, rows)}"


def _quiet(families: Sequence[FamilyName], controls: Controls) -> str:
    """Each contact where there should be next to none."""
    head = ["family", "control", "episode", "with", "at s", "ego m/s", "grade, or the failed rules", "signature"]
    rows: Rows = []
    for family in families:
        for control in (NOBODY, IDLE):
            for played in controls[family, control.name]:
                hit = played.collision
                if hit is None or hit.judgement is None:
                    continue
                failed = ", ".join(hit.broken)
                rows.append(
                    [
                        family,
                        control.name,
                        str(played.index),
                        hit.other_id,
                        f"{hit.time_s:.1f}",
                        f"{hit.ego_speed_mps:.1f}",
                        failed or str(hit.judgement.grade),
                        hit.judgement.signature,
                    ]
                )
    return f"## Contacts when nobody attacks on purpose\n\n{_table(head, rows) if rows else 'None.'}\n"


def _searches(runs: Sequence[Searched]) -> str:
    head = ["family", "method", "runs", "episodes", "contacts", "valid", "distinct", "preventable", "signatures"]
    head += ["release to conflict, s", "release to contact, s"]
    rows: Rows = []
    for family, method in dict.fromkeys((run.family, run.method) for run in runs):
        group = [run for run in runs if (run.family, run.method) == (family, method)]
        valid = [hit for run in group for hit in run.valid]
        preventable = [[hit for hit in run.valid if hit.preventable] for run in group]
        rows.append(
            [
                family,
                method,
                str(len(group)),
                str(sum(len(run.records) for run in group)),
                str(sum(len(run.contacts) for run in group)),
                str(len(valid)),
                str(sum(len(distinct_failures(run.valid)) for run in group)),
                str(sum(map(len, map(distinct_failures, preventable)))),
                str(len({hit.judgement.signature for hit in valid if hit.judgement})),
                _spread([hit.judgement.conflict_s for hit in valid if hit.judgement]),
                _spread([hit.time_s for hit in valid]),
            ]
        )
    return f"## The funnel of the searches (quartiles of the times)\n\n{_table(head, rows)}"


def _spread(values: Sequence[float]) -> str:
    if not values:
        return "-"
    ordered = sorted(values)
    at = [ordered[round(share * (len(ordered) - 1))] for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    return " / ".join(f"{value:.1f}" for value in at)


def _before_and_after(controls: Controls, runs: Sequence[Searched]) -> str:
    """What was wrong with the first definition of a failure, and how it is now."""
    valid = [hit for run in runs for hit in run.valid]
    mixed = [hit for run in runs if run.family == "mixed" for hit in run.valid]
    trained = {
        family: [hit.time_s for run in runs if (run.family, run.method) == (family, "risk-sac") for hit in run.valid]
        for family in ("low", "mixed", "dense")
    }
    otherwise = [hit for run in runs for hit in run.contacts if _fails_only(hit, "inside_grip")]
    early = [hit for run in runs for hit in run.contacts if _fails_only(hit, "conflict_after_release")]
    vehicles = [hit for hit in valid if hit.simulator_agrees is not None]
    unlisted = [hit for run in runs for hit in run.contacts if _fails_only(hit, "ego_model_saw")]
    hidden = [hit for hit in mixed if hit.judgement and hit.judgement.hidden]
    pedestrians = [hit for hit in valid if hit.judgement and hit.judgement.conflict_type is ConflictType.PEDESTRIAN]
    rows: Rows = [
        [
            "valid failures that vanish when SUMO takes the pedestrian's direction rightly",
            "130 of 367",
            f"cannot be: SUMO knows no pedestrian; {len(pedestrians)} of {len(valid)} are with one",
        ],
        ["valid, and the ego never braked for what it saw for 1.5 s", "-", _of(valid, _unresponsive)],
        ["need more grip than the road has", "19 of 367 counted as valid", f"{len(otherwise)} refused for it alone"],
        ["prevented by the careful driver", "20 of 367", _of(valid, lambda hit: hit.preventable)],
        ["conflict begins too early", "94 to 100 % within 0.35 s", f"{len(early)} within 1 s refused for it alone"],
        *(
            [
                f"median contact of risk-sac in {family}, s after the release; at 3 s or more",
                {"low": "1.1 to 1.4; 1 of 196", "mixed": "1.1 to 1.4; 1 of 200"}.get(family, "1.1 to 1.4"),
                f"{median(times):.1f}; {sum(t >= 3 for t in times)} of {len(times)}" if times else "no failure found",
            ]
            for family, times in trained.items()
        ),
        *(
            [f"contacts with all actions 0, {family}", before, _rate(controls.get((family, IDLE.name), ()))]
            for family, before in (("low", "-"), ("mixed", "22 of 150"), ("dense", "17 of 150"))
        ),
        ["valid failures of mixed with a hidden pedestrian", "2 to 4 %", f"{len(hidden)} of {len(mixed)}"],
        [
            "SUMO does not list what else were a valid failure (vehicles)",
            "9 to 30 % of valid failures",
            f"{len(unlisted)} of {len(vehicles) + len(unlisted)}, refused for it alone",
        ],
        *(
            [
                f"valid failures under random search in {family}, from the worst ego to the best",
                before,
                " / ".join(str(_valid(controls.get((family, rung.name), ()))) for rung in LADDER),
            ]
            for family, before in (
                ("low", "18 / 6 / 10 / 10"),
                ("mixed", "17 / 12 / 13 / 13"),
                ("dense", "25 / 16 / 18 / 18"),
            )
        ),
    ]
    return f"## Before and now\n\n{_table(['what', 'before', 'now'], rows)}"


def _fails_only(hit: Collision, rule: str) -> bool:
    return hit.broken == (rule,)


def _unresponsive(hit: Collision) -> bool:
    return hit.judgement is not None and hit.judgement.unresponsive


def _of(hits: Sequence[Collision], holds: Callable[[Collision], bool]) -> str:
    return f"{sum(map(holds, hits))} of {len(hits)}"


def _rate(played: Sequence[Played]) -> str:
    return f"{sum(p.collision is not None for p in played)} of {len(played)}"


def _valid(played: Sequence[Played]) -> int:
    return sum(p.collision is not None and p.collision.valid for p in played)


def _table(head: Sequence[str], rows: Rows) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
