"""Design problems that every program can state, with outputs in closed form: pure data, without any import of a program.

A point is one value of one factor, the time of a sample or a concentration, and each point gives one measurement. Times are in the
unit of the source; F is in the parameters' own units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class DesignCase:
    """One problem.

    Attributes
    ----------
    formula : str
        The output, in terms of `factor`, the parameters and exp.
    log_grid : bool
        Whether a user would space candidates and starts geometrically.
    f, g, start
        Equations of the states, output and initial states, for programs that take these; no states for a static model.
    has_pole : bool
        Whether the formula is 0/0 where two rates are equal, so that large differences of parameters step on it.
    """

    name: str
    parameters: dict[str, float]
    factor: str
    bounds: tuple[float, float]
    n_points: int
    sigma: float
    formula: str
    log_grid: bool
    g: str
    f: tuple[str, ...] = ()
    start: tuple[tuple[str, float], ...] = ()
    has_pole: bool = False

    def output(self, exp: Callable[[Any], Any]) -> Callable[[Any, dict[str, Any]], Any]:
        """Return the output as a function of the factor and the parameters, with a program's own exp."""
        code = compile(self.formula, self.name, "eval")
        return lambda x, parameters: eval(code, {"exp": exp}, {self.factor: x, **parameters})

    def spread(self, count: int) -> list[float]:
        """Return `count` values from bound to bound."""
        low, high = self.bounds
        shares = [i / (count - 1) for i in range(count)]
        return [low * (high / low) ** share if self.log_grid else low + share * (high - low) for share in shares]


CASES = (
    DesignCase(
        "Michaelis-Menten",
        {"V": 212.7, "K": 0.0641},
        "s",
        (0.0, 1.1),
        6,
        10.9,
        "V*s/(K + s)",
        False,
        g="V*s/(K + s)",
    ),
    DesignCase(
        "Box-Lucas",
        {"k_1": 0.7, "k_2": 0.2},
        "t",
        (0.01, 20.0),
        4,
        0.02,
        "k_1/(k_1 - k_2)*(exp(-k_2*t) - exp(-k_1*t))",
        False,
        g="B",
        f=("-k_1*A", "k_1*A - k_2*B"),
        start=(("A", 1.0), ("B", 0.0)),
        has_pole=True,
    ),
    DesignCase(
        "one compartment with absorption",
        {"k_a": 4.298, "k_e": 0.05884, "V": 0.6976},
        "t",
        (0.01, 48.0),
        6,
        1.0,
        "15/V*k_a/(k_a - k_e)*(exp(-k_e*t) - exp(-k_a*t))",
        True,
        g="c",
        f=("-k_a*d", "k_a*d/V - k_e*c"),
        start=(("d", 15.0), ("c", 0.0)),
        has_pole=True,
    ),
    DesignCase(
        "three exponentials",
        {"a_1": 1.0, "a_2": 0.5, "a_3": 0.2, "k_1": 5.0, "k_2": 0.8, "k_3": 0.05},
        "t",
        (0.01, 60.0),
        6,
        0.01,
        "a_1*exp(-k_1*t) + a_2*exp(-k_2*t) + a_3*exp(-k_3*t)",
        True,
        g="a_1*x + a_2*y + a_3*z",
        f=("-k_1*x", "-k_2*y", "-k_3*z"),
        start=(("x", 1.0), ("y", 1.0), ("z", 1.0)),
    ),
)
