"""How far points keep away from jumps and limits, so that a share of the plants can run all of them.

Every point has to be ok on some plants that are drawn from the prior, but deviate w times as far from its mean. Of n independent
draws in the direction in which a point fails first, the largest is at about Phi^-1(1 - 1/n) standard deviations; a point that runs
on all fails on plants beyond w times that. How many plants a whole design loses depends on how many of its points fail on the same
ones. So they are counted, on other plants, and w changes in proportion to the quantiles of what is lost and what may be.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

from ...information.draws import drawn_plants
from ...information.feasibility import feasibility
from ...information.problem import DesignProblem
from ...information.validity import Validity
from ...points.experiments import Experiments
from ..results.settings import ExchangeSettings
from .tuning import PlantTuning

COUNTED_SEED = 2_000_003
"""Added to the seed for the plants on which the share is counted."""


QUANTILE = NormalDist().inv_cdf
"""Quantile function of the normal distribution; SciPy's would make the import slow."""


class Away:
    """The plants on which all points have to be ok.

    Parameters
    ----------
    problem : DesignProblem
    settings : ExchangeSettings
        With the required share of the plants, the goal's `confidence`.
    validity : Validity
        Which plants can run which points.
    tuning : PlantTuning, optional
    """

    def __init__(
        self, problem: DesignProblem, settings: ExchangeSettings, validity: Validity, tuning: PlantTuning = PlantTuning()
    ) -> None:
        self.tuning = tuning
        share = settings.goal.share_of_plants
        assert share is not None
        self._problem, self._seed, self._validity = problem, settings.seed, validity
        self._may = 1.0 - share
        self._most = self.tuning.most_lost * self._may
        self.wider = QUANTILE(1.0 - self._most / settings.n_experiments**0.5) / QUANTILE(1.0 - 1.0 / self.tuning.plants)
        self._low, self._high, self._changes = 0.0, np.inf, 0
        self._ask()

    def _ask(self) -> None:
        plants, _ = drawn_plants(self._problem, self.tuning.plants, np.random.default_rng([self._seed, 4]), self.wider)
        self._validity.ask(plants)

    def lost(self, points: Experiments) -> float:
        """The share of the counted plants that cannot run all points."""
        return 1.0 - feasibility(self._problem, points, draws=self.tuning.counted_plants, seed=self._seed + COUNTED_SEED).share

    def enough(self, lost: float) -> bool:
        """Whether no more plants are lost than may be."""
        return lost <= self._most

    def change(self, lost: float) -> bool:
        """Ask for plants that deviate further, or less, by what a design has lost of those that are counted; False for the end."""
        tuning = self.tuning
        if self.enough(lost):
            self._high = min(self._high, self.wider)
        else:
            self._low = max(self._low, self.wider)
        done = self.enough(lost) and lost >= tuning.least_lost * self._may
        if done or self._changes == tuning.most_changes or self._high < tuning.least_change * self._low:
            return False
        self._changes += 1
        middle, factors = (self._most + tuning.least_lost * self._may) / 2, tuning.change_factors
        wanted = QUANTILE(1.0 - middle) / QUANTILE(1.0 - max(lost, 1.0 / tuning.counted_plants))
        factor = np.clip(wanted, *factors) if 0.0 < lost < 0.5 else factors[int(lost > 0.0)]
        self.wider *= float(factor)
        if not self._low < self.wider < self._high:
            self.wider = float(np.sqrt(self._low * self._high))
        self._ask()
        return True
