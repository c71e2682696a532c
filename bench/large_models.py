"""``python -m bench.large_models``: large models, interpreted and compiled, on one core.

Processor time of both in turn, the least of several rounds, and what `compile()` takes where no cache has the model, with its
compilers. Results must be the same to the last bit. The platform is that of ``examples/hexapod.py``; a chain has masses whose
springs have stiffnesses of their own.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import resource
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import fisherpoint as fp
from examples.hexapod import hexapod, prior

from .timing import least_seconds

BATCH = 64
ROUNDS = 5
FOLDER = Path(__file__).resolve().parents[2] / "shared" / "hexapod"


def platform(variant: int, friction: str) -> tuple[Any, fp.Experiments, dict[str, float]]:
    """The platform with that many parameters, at random points."""
    found = importlib.util.spec_from_file_location("hexapod", FOLDER / "hexapod.py")
    if found is None or found.loader is None:
        raise FileNotFoundError(f"expected the platform's numbers in {FOLDER}, found none")
    hx = importlib.util.module_from_spec(found)
    found.loader.exec_module(hx)
    box = hx.region()
    low, high = (np.array([box[k][j] for k in box], float) for j in (0, 1))
    draws = low + (high - low) * np.random.default_rng(1).random((BATCH, len(low)))
    return hexapod(variant, friction), fp.Experiments(draws[:, :30], draws[:, 30:36], draws[:, 36]), dict(prior(variant).mean)


def chain(states: int) -> tuple[Any, fp.Experiments, dict[str, float]]:
    """Masses between springs, the first one held, the last one pulled; as many parameters as states."""
    count = states // 2
    rates = [f"v{i}" for i in range(count)]
    for i in range(count):
        before = f"k{i}*(x{i - 1} - x{i}) + d{i}*(v{i - 1} - v{i})" if i else "-k0*x0 - d0*v0"
        behind = f"k{i + 1}*(x{i + 1} - x{i}) + d{i + 1}*(v{i + 1} - v{i})" if i < count - 1 else "tanh(u)"
        rates.append(f"{before} + {behind}")
    names = [f"{area}{i}" for area in ("x", "v") for i in range(count)]
    theta = {f"k{i}": 4.0 for i in range(count)} | {f"d{i}": 0.1 for i in range(count)}
    model = fp.SymbolicModel(
        rates, [f"x{count - 1}"], dict.fromkeys(names, ("1", 1.0)), {"u": "1"}, dict.fromkeys(theta, "1"), check_units=False
    )
    u = np.random.default_rng(0).uniform(0.5, 1.5, (BATCH, 1))
    return model, fp.Experiments(np.zeros((BATCH, states)), u, np.full(BATCH, 2.0)), theta


CASES: dict[str, Callable[[], tuple[Any, fp.Experiments, dict[str, float]]]] = {
    "platform, 54 parameters": lambda: platform(54, "coulomb"),
    "platform, 54 parameters, tanh": lambda: platform(54, "tanh"),
    "platform, 64 parameters": lambda: platform(64, "coulomb"),
    "chain, 40 parameters": lambda: chain(40),
    "chain, 200 parameters": lambda: chain(200),
}


def built(model: Any) -> tuple[Any, float, float]:
    """The model compiled anew, with processor time and seconds."""
    with tempfile.TemporaryDirectory() as cache:
        os.environ["FISHERPOINT_CACHE"] = cache
        before, began = _used(), perf_counter()
        compiled = model.compile()
        return compiled, _used() - before, perf_counter() - began


def _used() -> float:
    return sum(of.ru_utime + of.ru_stime for of in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def rows(names: list[str]) -> Iterator[str]:
    """Lines of the table."""
    for name in names:
        model, points, theta = CASES[name]()
        model.core  # noqa: B018
        compiled, used, lasted = built(model)
        if not compiled.compiled:
            raise RuntimeError(f"{name}: expected a model that is compiled, given one that stays interpreted")
        both = {"interpreted": model, "compiled": compiled}
        for what, of in (("simulate", fp.simulate), ("sensitivities", fp.sensitivities)):
            tasks: dict[str, Callable[[], Any]] = {key: partial(of, m, points, theta, threads=1) for key, m in both.items()}
            one, other = (arrays_of(task()) for task in tasks.values())
            bits = "the same" if one == other else "others"
            times = {key: 1e3 * seconds / BATCH for key, seconds in least_seconds(tasks, ROUNDS).items()}
            ratio = times["interpreted"] / times["compiled"]
            each = f"{times['interpreted']:.3f} | {times['compiled']:.3f} | {ratio:.2f}"
            yield f"| {name} | {used:.1f} | {lasted:.1f} | {what} | {each} | {bits} |"


def arrays_of(result: Any) -> list[bytes]:
    """The bits of a result."""
    return [getattr(result, name).tobytes() for name in ("x", "y", "dx_dtheta", "dy_dtheta", "status") if hasattr(result, name)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.large_models", description=__doc__)
    parser.add_argument("--of", nargs="+", choices=list(CASES), default=list(CASES))
    heads = "model", "compile(), s of processors", "s", "of", "interpreted, ms each", "compiled", "ratio", "bits"
    print(f"| {' | '.join(heads)} |", "|---|--:|--:|---|--:|--:|--:|---|", sep="\n")
    for row in rows(parser.parse_args().of):
        print(row, flush=True)


if __name__ == "__main__":
    main()
