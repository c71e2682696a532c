"""The criteria by their letters: the one table of their words, and of what a goal gives with them.

How one is computed is a class below `criteria.Criterion`, which `goal_criterion.criterion` makes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class CriterionRow:
    """Words and kind of a criterion; phi is its information function.

    Attributes
    ----------
    words : str
        Its value, as part of a sentence.
    named : str
        The same with ``{of}`` for what it is of; empty where it is of all parameters.
    meaning : str
        What it is, in a line.
    error, of_error : str
        Name and meaning of phi^(-1/2), by which designs of several sizes are compared.
    needs : str
        What `of` of the goal is; empty where it is of all parameters.
    scaled : bool
        Whether it depends on how the parameters are scaled.
    minimised : bool
        Whether it is better the smaller it is.
    log_det : bool
        Whether it is a log det, which is maximised itself, and not its logarithm.
    variance : bool
        Whether its root is the standard deviation of something in units of its own.
    relative : bool
        Whether `error` is a share of the prior's standard deviations, or of other scales.
    """

    words: str
    named: str = ""
    meaning: str
    error: str
    of_error: str
    needs: str = ""
    scaled: bool = False
    minimised: bool = False
    log_det: bool = False
    variance: bool = False
    relative: bool = True

    @property
    def of_all(self) -> bool:
        """Whether it is of all parameters, and not of certain functions of them."""
        return not self.needs


CRITERIA: Mapping[str, CriterionRow] = {
    "D": CriterionRow(
        words="log det F",
        meaning="log det of the information: the volume of the confidence ellipsoid",
        error="mean error",
        of_error="det(F)^(-1/2p), the geometric mean over the directions of the parameters, in prior std",
        log_det=True,
    ),
    "A": CriterionRow(
        words="trace of F^-1",
        meaning="the sum of the variances of the parameters",
        error="joint error",
        of_error="the root of the trace of F^-1, of errors next to their scales",
        scaled=True,
        minimised=True,
    ),
    "E": CriterionRow(
        words="smallest eigenvalue of F",
        meaning="the least eigenvalue of the information: the worst combination of the parameters",
        error="largest error",
        of_error="that of the combination of parameters that is known worst, next to its scale",
        scaled=True,
    ),
    "ME": CriterionRow(
        words="condition number of F",
        meaning="the condition number of the information",
        error="error ratio",
        of_error="the largest error of a combination of parameters over the smallest",
        scaled=True,
        minimised=True,
        relative=False,
    ),
    "c": CriterionRow(
        words="variance of the function",
        named="variance of {of}",
        meaning="the variance of one function of the parameters",
        error="error",
        of_error="the standard deviation of the function",
        needs="a function of the parameters as text",
        minimised=True,
        variance=True,
        relative=False,
    ),
    "Ds": CriterionRow(
        words="log det of the information about the subset",
        named="log det of the information about {of}",
        meaning="log det of the information of some parameters",
        error="mean error",
        of_error="the geometric mean over the directions of the chosen parameters, in prior std",
        needs="names of parameters",
        log_det=True,
    ),
    "I": CriterionRow(
        words="mean prediction variance",
        named="mean prediction variance of {of}",
        meaning="the mean variance of predictions",
        error="error",
        of_error="the root of the mean variance of the predictions",
        needs="the name of an output",
        minimised=True,
        variance=True,
        relative=False,
    ),
}
