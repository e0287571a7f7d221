import numpy as np
import pytest

from risk_sac.verdicts.evidence import PER_ACTOR, Evidence
from risk_sac.verdicts.judge import judge
from tests.unit.verdicts.staged import STREET, cut_in, leader_brakes


def test_a_striker_that_has_left_cannot_have_struck() -> None:
    evidence = cut_in()
    evidence.x_m[-1, 1] = np.nan
    with pytest.raises(ValueError, match="'actor_1' has left"):
        evidence.column("actor_1")
    with pytest.raises(ValueError, match="'actor_0' is not among"):
        evidence.column("actor_0")


@pytest.mark.parametrize("evidence", [cut_in(), leader_brakes()], ids=["cut-in", "leader"])
def test_what_is_stored_is_judged_alike(evidence: Evidence) -> None:
    names = (*PER_ACTOR, "link", "kind", "role", "length_m", "width_m")
    stored = {name: getattr(evidence, name) for name in names} | {"ids": np.array(evidence.ids)}
    stored |= {"time_s": evidence.time_s + 1.5, "visible": np.where(evidence.known, 1.0, np.nan)}
    first = judge(evidence, "actor_1", valid=True)
    again = judge(Evidence.from_series(stored, STREET, 1.5), "actor_1", valid=True)
    assert (again.conflict_s, again.noticed_s) == pytest.approx((first.conflict_s, first.noticed_s))
    assert again.model_copy(update={"conflict_s": first.conflict_s, "noticed_s": first.noticed_s}) == first
