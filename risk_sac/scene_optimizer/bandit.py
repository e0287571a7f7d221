"""Bandit that chooses between two ways to search by their recent yield per cost."""

from typing import Any


class DiscountedBandit:
    """Two arms; the chance of each goes by the square of its discounted yield.

    yield_i = (prior_yield · prior_cost + Σ discount^k worth) / (prior_cost + Σ discount^k cost),  p_i ∝ yield_i²

    k counts the later pulls of the same arm, so an arm that is not pulled keeps its yield.
    """

    def __init__(
        self,
        *,
        discount: float,
        prior_worth: float,
        prior_cost: float,
        least: float,
        unit_costs: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        """Begins without experience: both arms are as likely.

        Args:
          discount: weight of a pull after one more pull of the same arm.
          prior_worth: worth that an untried arm is credited with.
          prior_cost: cost that this worth is taken to have had.
          least: smallest share of all costs that is spent on either arm.
          unit_costs: cost of a unit of effort of each arm; only their ratio counts.
        """
        self._discount, self._prior_worth, self._prior_cost = discount, prior_worth, prior_cost
        self._unit_costs = unit_costs
        self._bounds = self._probability_of(least), self._probability_of(1.0 - least)
        self._worth, self._spent = [0.0, 0.0], [0.0, 0.0]

    @property
    def probability(self) -> float:
        """Returns the probability of pulling arm 1 next.

        Both arms' pulls are taken to need equal effort.
        """
        first, second = (
            ((worth + self._prior_worth) / (spent + self._prior_cost)) ** 2
            for worth, spent in zip(self._worth, self._spent, strict=True)
        )
        low, high = self._bounds
        return min(max(second / (first + second), low), high)

    def tell(self, arm: int, worth: float, effort: float = 1.0) -> None:
        """Counts a pull of arm 0 or 1, its worth and its effort."""
        self._worth[arm] = self._discount * self._worth[arm] + worth
        self._spent[arm] = self._discount * self._spent[arm] + self._unit_costs[arm] * effort

    def state(self) -> dict[str, Any]:
        """Plain values, to continue from."""
        return {"worth": list(self._worth), "spent": list(self._spent)}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self._worth, self._spent = list(state["worth"]), list(state["spent"])

    def _probability_of(self, share: float) -> float:
        """Chance of arm 1 with which it spends this share of all costs."""
        first, second = self._unit_costs
        return share * first / (share * first + (1.0 - share) * second)
