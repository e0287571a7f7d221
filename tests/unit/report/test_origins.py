"""Origins of failures: as written, by searched parameters, or by deviating actors."""

from risk_sac.config import RunSpec
from risk_sac.records import Grade, Outcome, StoryDeviation
from risk_sac.report.runs import FinishedRun, PlayedAs, failure_origins
from tests.builders import collision, episode_record, judgement


def run(method, *failures, **changes):
    """Run with a safe episode and a failure of each given kind."""
    records = [episode_record(0, Outcome.SAFE)]
    for index, kind in enumerate(failures, 1):
        contact = collision(judgement=judgement(Grade.PREVENTABLE, kind=kind))
        records.append(episode_record(index, Outcome.FAILURE, collision=contact, **changes))
    spec = RunSpec(family="low", method=method, seed=0)
    return FinishedRun(spec=spec, digest="", records=tuple(records), versions={}, wall_s=1.0, cpu_s=1.0)


def strayed(speed_mps, across_m, trigger_s):
    strayed = StoryDeviation(speed_mps=speed_mps, lateral_mps=0.0, along_m=0.0, across_m=across_m, trigger_s=trigger_s)
    return {"left": strayed}


def test_each_way_to_play_adds_the_kinds_that_the_ways_before_lack():
    rows = failure_origins(
        [
            run("archive", "a", "b", "c", deviations=strayed(1.5, 0.2, 0.3)),
            run("story-bo", "a", "b"),
            run("story-sweep", "a"),
            run("no-adversary", "z"),
        ]
    )
    assert [(row.played, row.methods, row.failures, row.kinds, row.new_kinds) for row in rows] == [
        (PlayedAs.AS_WRITTEN, ("story-sweep",), 1, 1, 1),
        (PlayedAs.SEARCHED, ("story-bo",), 2, 2, 1),
        (PlayedAs.DEVIATING, ("archive",), 3, 3, 1),
    ]
    assert [row.least_speed_mps for row in rows] == [None, None, 1.5]
    assert (rows[2].least_across_m, rows[2].least_trigger_s) == (0.2, 0.3)


def test_nothing_is_said_of_scenarios_that_no_method_plays_as_written():
    assert failure_origins([run("archive", "a")]) == ()
