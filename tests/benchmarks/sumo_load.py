"""What libsumo's load takes without and with its XML parser kept; a program of its own, since it is kept for good.

Run: python -m tests.benchmarks.sumo_load; prints processor milliseconds for each family's net as JSON.
"""

import json
import time

import libsumo
import numpy as np

from risk_sac.scenario.families import FAMILIES
from risk_sac.sim.parser import keep_parser
from risk_sac.sim.sumo import NETS, OPTIONS

LOADS = 200


def options(net: str) -> list[str]:
    return ["-n", str(NETS / net), "-a", str(NETS / "vtypes.add.xml"), *OPTIONS]


def load_ms(net: str) -> float:
    started = time.process_time()
    for _ in range(LOADS):
        libsumo.load(options(net))
    return 1e3 * (time.process_time() - started) / LOADS


def main() -> None:
    nets = {
        name: family.layout(family.space.from_unit(np.full(family.space.dimension, 0.5)).values).net
        for name, family in FAMILIES.items()
    }
    libsumo.start(["sumo", *options(nets["low"])])
    anew = {name: load_ms(net) for name, net in nets.items()}
    keep_parser()
    kept = {name: load_ms(net) for name, net in nets.items()}
    print(json.dumps({name: (anew[name], kept[name]) for name in nets}))


if __name__ == "__main__":
    main()
