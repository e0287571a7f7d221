"""On what ground the striker was struck."""

from risk_sac.types import Kind
from risk_sac.verdicts.areas import inside
from risk_sac.verdicts.evidence import Evidence

BESIDE_M = 3.0  # a pedestrian this near to a crossing means to use it


def ground(evidence: Evidence, striker: int) -> str:
    """lane, junction, crossing or beside_crossing; crossings matter to pedestrians only."""
    where, here = evidence.ground, (evidence.x_m[-1:, striker], evidence.y_m[-1:, striker])
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        if inside(where.crossings, *here)[0]:
            return "crossing"
        if inside(where.crossings, *here, BESIDE_M)[0]:
            return "beside_crossing"
    return "junction" if inside(where.junctions, *here)[0] else "lane"
