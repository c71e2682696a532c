"""Chi-square of the residuals of each output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class OutputTest:
    """Chi-square of one output's residuals: their number, degrees of freedom, and the probability of more by chance.

    Where the noise is estimated, chi-square equals the degrees of freedom by construction, and `p_value` is None.
    """

    count: int
    chi_square: float
    degrees_of_freedom: float
    p_value: float | None

    @classmethod
    def of(cls, count: int, chi_square: float, degrees_of_freedom: float, unit: float | None) -> OutputTest:
        """The test where squares scatter `unit` times as much as those of normal residuals; None where the noise is estimated.

        Chi-square then has the mean and the variance of one of degrees_of_freedom / unit degrees of freedom, times the unit.
        """
        from scipy.stats import chi2

        p_value = None
        if unit is not None and degrees_of_freedom > 1e-9:
            p_value = float(chi2.sf(chi_square / unit, degrees_of_freedom / unit))
        return cls(count, chi_square, degrees_of_freedom, p_value)

    @property
    def per_degree_of_freedom(self) -> float:
        """Chi-square per degree of freedom: 1 where the model and the noise are right; inf where nothing is left to judge by."""
        return self.chi_square / self.degrees_of_freedom if self.degrees_of_freedom > 1e-9 else np.inf
