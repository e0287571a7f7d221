import hashlib
import json
import math
from types import MappingProxyType

import numpy as np
import pytest

from risk_sac.metrics import results_digest
from tests.builders import judgement
from tests.unit.metrics.episodes import RUN, episode

# Fields of an episode that older records lack.
NEWER = ("script", "driven_by", "failed", "requirements", "violations", "defect_reached_s")


def test_digest_is_the_hash_of_canonical_json():
    assert results_digest([]) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert results_digest(RUN) == results_digest(list(RUN))


def test_records_from_before_contacts_were_judged_keep_their_digest():
    # As the version before wrote it: of this very record, by hand.
    old = json.loads(json.dumps(RUN[0].model_dump(by_alias=False))) | {"phase": "train"}
    for name in NEWER:
        del old[name]
    del old["collision"]["judgement"]
    line = json.dumps(old, sort_keys=True, separators=(",", ":")).encode() + b"\n"
    assert results_digest([RUN[0]]) == hashlib.sha256(line).hexdigest()
    judged = RUN[0].model_copy(update={"collision": RUN[0].collision.model_copy(update={"judgement": judgement()})})
    assert results_digest([judged]) != results_digest([RUN[0]])


def test_records_that_are_judged_without_the_moment_of_notice_keep_their_digest():
    older = {"judgement": judgement(severity=None, injury_risk=None)}
    judged = RUN[0].model_copy(update={"collision": RUN[0].collision.model_copy(update=older)})
    old = json.loads(json.dumps(judged.model_dump(mode="json", by_alias=False))) | {"phase": "train"}
    for name in NEWER:
        del old[name]
    for name in ("noticed_s", "ego_broke", "severity", "injury_risk", "fault", "ego_part"):
        del old["collision"]["judgement"][name]
    line = json.dumps(old, sort_keys=True, separators=(",", ":")).encode() + b"\n"
    assert results_digest([judged]) == hashlib.sha256(line).hexdigest()


def test_digest_does_not_depend_on_the_order_or_kind_of_mappings():
    scene = {"gap_m": 10.0, "speed_mps": 12.5}
    turned = MappingProxyType(dict(reversed(scene.items())))
    assert results_digest([episode(scene=scene)]) == results_digest([episode(scene=turned)])


@pytest.mark.parametrize(
    "change", [{"risk_return": math.nextafter(1.0, 2)}, {"steps": 149}, {"scene": {"gap_m": 10.0}}, {"objective": None}]
)
def test_digest_notices_the_smallest_change(change):
    assert results_digest([RUN[1].model_copy(update=change)]) != results_digest([RUN[1]])
    assert results_digest(RUN[::-1]) != results_digest(RUN)


def test_digest_accepts_infinities_and_refuses_foreign_values():
    assert len(results_digest([episode(min_ttc_s=math.inf)])) == 64
    with pytest.raises(TypeError, match="canonical JSON"):
        results_digest([episode().model_copy(update={"scene": {"gap_m": np.float32(1)}})])
