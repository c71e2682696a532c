"""Design problems on which searches are compared: the cylinder, the examples, FitzHugh-Nagumo, Arrhenius, and response surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import fisherpoint as fp

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


@dataclass(frozen=True)
class Case:
    """A problem and the number of points."""

    name: str
    problem: Callable[[], fp.DesignProblem]
    n_experiments: int


def example(name: str, kind: str | None = None, jumps: str | None = None) -> Callable[[], fp.DesignProblem]:
    def made() -> fp.DesignProblem:
        changes = {key: value for key, value in (("output_covariance", kind), ("jumps", jumps)) if value is not None}
        return fp.load_problem(EXAMPLES / f"{name}.toml").replace(**changes)

    return made


def fitzhugh_nagumo() -> fp.DesignProblem:
    """A spiking cell: the fast voltage is measured, the slow recovery is not."""
    model = fp.SymbolicModel(
        ["c*(V - V**3/3 + R + I)", "-(V - a + b*R)/c"],
        ["V"],
        {"V": "1", "R": "1"},
        {"I": "1"},
        {"a": "1", "b": "1", "c": "1/s"},
        {"y": "1"},
    )
    prior = fp.GaussianPrior(mean={"a": 0.2, "b": 0.2, "c": 3.0}, std={"a": 0.04, "b": 0.04, "c": 0.3})
    region = fp.ExperimentRegion({"V": (-2, 2), "R": (-1, 1), "I": (-0.5, 0.5), "dt": (0.05, 2)})
    return fp.DesignProblem(model, prior, region, noise={"y": 0.05})


def arrhenius() -> fp.DesignProblem:
    """Two reactions in a row, A -> B -> C, at a temperature that is held; rates at 350 K and activation energies, in units of R."""
    k_1, k_2 = "k_1*exp(-1000*E_1*(1/T - 1/350))", "k_2*exp(-1000*E_2*(1/T - 1/350))"
    model = fp.SymbolicModel(
        [f"-{k_1}*A", f"{k_1}*A - {k_2}*B"],
        ["A", "B"],
        {"A": "mol/l", "B": "mol/l"},
        {"T": "K"},
        {"k_1": "1/s", "E_1": "kK", "k_2": "1/s", "E_2": "kK"},
        {"y_A": "mol/l", "y_B": "mol/l"},
    )
    mean = {"k_1": 0.1, "E_1": 8.0, "k_2": 0.03, "E_2": 10.0}
    prior = fp.GaussianPrior(mean=mean, std={name: 0.1 * value for name, value in mean.items()})
    region = fp.ExperimentRegion({"A": (0, 1), "B": (0, 1), "T": (320, 380), "dt": (0.5, 60)}, constraints=["A + B < 1.2"])
    return fp.DesignProblem(model, prior, region, noise={"y_A": 0.01, "y_B": 0.01})


def quadratic(factors: int) -> fp.DesignProblem:
    """The full quadratic on three levels of each factor."""
    names = "abc"[:factors]
    levels = {name: f"where({name} > 1/3, 1, where({name} < -1/3, -1, 0))" for name in names}
    of = [levels[name] for name in names]
    terms = ["1", *of, *(f"({x})**2" for x in of), *(f"({x})*({y})" for i, x in enumerate(of) for y in of[i + 1 :])]
    parameters = [f"c_{i}" for i in range(len(terms))]
    model = fp.SymbolicModel(
        [],
        [" + ".join(f"{c}*({term})" for c, term in zip(parameters, terms, strict=True))],
        {},
        dict.fromkeys(names, "1"),
        dict.fromkeys(parameters, "1"),
        {"y": "1"},
    )
    prior = fp.GaussianPrior(mean=dict.fromkeys(parameters, 0.0), std=dict.fromkeys(parameters, 1.0))
    return fp.DesignProblem(model, prior, fp.ExperimentRegion(dict.fromkeys(names, (-1.0, 1.0))), noise={"y": 1.0})


KINDS = ("noise", "region", "pooled", "pointwise")
CASES = (
    *(Case(f"cylinder, {kind}", example("cylinder", kind), 12) for kind in KINDS),
    Case("cylinder, noise, jumps excluded", example("cylinder", "noise", "exclude"), 12),
    Case("FitzHugh-Nagumo", fitzhugh_nagumo, 12),
    Case("Arrhenius", arrhenius, 12),
    Case("Michaelis-Menten", example("michaelis_menten"), 6),
    Case("Box-Lucas", example("box_lucas"), 6),
    Case("DC motor", example("dc_motor"), 12),
    Case("pharmacokinetics", example("pharmacokinetics"), 9),
    *(Case(f"quadratic in 2 factors, N = {n}", lambda: quadratic(2), n) for n in range(6, 15)),
    *(Case(f"quadratic in 3 factors, N = {n}", lambda: quadratic(3), n) for n in (10, 12, 14)),
)
