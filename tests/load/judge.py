"""What the phases say about the promises. Pure.

Throughput is environment steps per second of wall time. The generator needs processor time of the machine that it
measures, which clients elsewhere would not: where there are as many workers as cores, what it uses is taken from them.
So two losses are told: the raw one, and the one that is left when the workers are given back the generator's processor
time, to be used at the pace they had, but never more time than they had while it was quiet. The second is what the
service's own answers cost the campaigns, and it is the one that is judged. Caches that the generator empties stay on
the service's account.
"""

import statistics
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain

from tests.load.campaigns import Phase
from tests.load.verdicts import Verdict, at_most, percentile

LATENCY_MS, LOSS = 100.0, 0.10
GROWTH_MIB, GROWTH_FILES = 10.0, 5.0  # over all loaded phases but the first, in which pools fill up


def judge(phases: Sequence[Phase]) -> list[Verdict]:
    """All verdicts on quiet and loaded phases, of which there are equally many."""
    loaded = [phase for phase in phases if phase.loaded]
    quiet = [phase for phase in phases if not phase.loaded]
    return [*_latencies(loaded), *_streams(loaded), *_throughput(quiet, loaded), *_flatness(loaded)]


def loss(quiet: Sequence[Phase], loaded: Sequence[Phase], *, given_back: bool) -> float:
    """Share of the quiet throughput that is lost under load.

    Args:
      quiet: phases without load.
      loaded: phases with it.
      given_back: whether workers get the generator's processor time back.
    """
    pace = sum(phase.steps for phase in loaded) / sum(phase.wall_s for phase in loaded)
    if given_back:
        had = _share(quiet, "workers_s")
        has = _share(loaded, "workers_s")
        pace *= max(has, min(had, has + _share(loaded, "generator_s"))) / has
    return 1 - pace / (sum(phase.steps for phase in quiet) / sum(phase.wall_s for phase in quiet))


def _share(phases: Sequence[Phase], name: str) -> float:
    """Cores that were kept busy."""
    return sum(getattr(phase, name) for phase in phases) / sum(phase.wall_s for phase in phases)


def _latencies(loaded: Sequence[Phase]) -> Iterator[Verdict]:
    errors = Counter[str]()
    for phase in loaded:
        errors.update(phase.seen["errors"])
    told = ", ".join(f"{what} ({count}×)" for what, count in errors.most_common(5))
    polls = 0
    for kind in loaded[0].seen["latencies_ms"]:
        seen = list(chain.from_iterable(phase.seen["latencies_ms"][kind] for phase in loaded))
        polls += len(seen)
        figures = (percentile(seen, 50), percentile(seen, 95), max(seen))
        note = "; p50 {:.1f}, p95 {:.1f}, max {:.0f}".format(*figures)
        yield at_most(f"polls of {kind}: p99", LATENCY_MS, percentile(seen, 99), "ms", note)
    yield Verdict("errors", "none", told or f"none in {polls:,} polls", not errors)


def _streams(loaded: Sequence[Phase]) -> Iterator[Verdict]:
    """Streams go on from phase to phase, so the last one tells of all."""
    seen = loaded[-1].seen
    told = f"{seen['episodes']:,} in {seen['connections']} connections"
    broken = {name: seen[name] for name in ("repeated", "missing") if seen[name]}
    told += "".join(f", {count} {name}" for name, count in broken.items())
    yield Verdict("every stream sees every episode", "exactly once", told, not broken)


def _throughput(quiet: Sequence[Phase], loaded: Sequence[Phase]) -> Iterator[Verdict]:
    pairs = [loss([a], [b], given_back=True) for a, b in zip(quiet, loaded, strict=True)]
    error = statistics.stdev(pairs) / len(pairs) ** 0.5
    own, raw = (100 * loss(quiet, loaded, given_back=given_back) for given_back in (True, False))
    yield at_most("campaigns slowed down by the service", 100 * LOSS, own, "%", f" (± {100 * error:.1f})")
    yield Verdict("… by service and generator", "", f"{raw:.3g} %")
    had, has, generator, server, idle = (
        _share(*of)
        for of in (
            (quiet, "workers_s"),
            (loaded, "workers_s"),
            (loaded, "generator_s"),
            (loaded, "server_s"),
            (quiet, "server_s"),
        )
    )
    yield Verdict("cores of the workers", "", f"{had:.3f} quiet, {has:.3f} loaded")
    yield Verdict("cores of server, generator", "", f"{server:.3f} ({idle:.3f} quiet), {generator:.3f}")
    polls = sum(len(times) for phase in loaded for times in phase.seen["latencies_ms"].values())
    per_poll = 1e3 * (server - idle) * sum(phase.seen["seconds"] for phase in loaded) / polls
    yield Verdict("server's processor time per poll", "", f"{per_poll:.2f} ms, streams included")
    episodes, wall_s = (sum(getattr(phase, name) for phase in loaded) for name in ("episodes", "wall_s"))
    yield Verdict("episodes finished under load", "", f"{episodes / wall_s:.1f} per second")


def _flatness(loaded: Sequence[Phase]) -> Iterator[Verdict]:
    first, last = loaded[1].holding, loaded[-1].holding
    minutes = sum(phase.wall_s for phase in loaded[1:]) / 60
    note = f" in {minutes:.0f} min: {first.memory_mib:.0f} to {last.memory_mib:.0f}"
    yield at_most("server's memory grows by", GROWTH_MIB, last.memory_mib - first.memory_mib, "MiB", note)
    note = f": {first.files:.0f} to {last.files:.0f}"
    yield at_most("open files grow by", GROWTH_FILES, last.files - first.files, "", note)
