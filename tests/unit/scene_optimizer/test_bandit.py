"""The bandit, by yields worked out by hand."""

import pytest

from risk_sac.scene_optimizer import DiscountedBandit

DISCOUNT, WORTH, COST, LEAST = 0.9, 0.5, 5.0, 0.05


def bandit(*unit_costs: float) -> DiscountedBandit:
    return DiscountedBandit(
        discount=DISCOUNT, prior_worth=WORTH, prior_cost=COST, least=LEAST, unit_costs=unit_costs or (1.0, 1.0)
    )


def test_the_chance_follows_the_square_of_what_each_yielded_for_its_cost() -> None:
    subject = bandit(1.0, 4.0)
    subject.tell(0, 1.0, 10)
    subject.tell(1, 3.0, 10)
    subject.tell(1, 0.0, 10)
    first = (WORTH + 1.0) / (COST + 10)
    second = (WORTH + DISCOUNT * 3.0) / (COST + (DISCOUNT + 1) * 4 * 10)
    assert subject.probability == pytest.approx(second**2 / (first**2 + second**2))


@pytest.mark.parametrize("better", [0, 1])
def test_the_worse_arm_spends_the_least_share_of_all_costs(better: int) -> None:
    subject = bandit(1.0, 4.0)
    for _ in range(200):
        subject.tell(better, 1.0)
        subject.tell(1 - better, 0.0)
    spent = 1.0 - subject.probability, 4.0 * subject.probability
    assert spent[1 - better] / sum(spent) == pytest.approx(LEAST)


def test_it_continues_from_its_state() -> None:
    subject, other = bandit(), bandit()
    subject.tell(1, 1.0)
    other.load(subject.state())
    assert other.probability == subject.probability != 0.5
    other.tell(0, 2.0)  # the state is a copy
    assert other.probability != subject.probability
