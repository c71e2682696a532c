"""``python -m bench.construction``: CPU seconds that a large model takes to be made, printed, pickled, saved and read.

The model is the platform of `examples/hexapod.py`; one in which nothing is written out twice is in the folder `shared` beside this
repository. Each figure is the least of three, with SymPy's memory emptied before.
"""

from __future__ import annotations

import importlib.util
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

from sympy.core.cache import clear_cache

from examples.hexapod import hexapod
from fisherpoint.models.toml_to_model import model_from_toml

NUMBERS = Path(__file__).resolve().parents[2] / "shared" / "hexapod" / "hexapod.py"


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """The least of three CPU times, and what was made."""
    least = float("inf")
    for _ in range(3):
        clear_cache()
        begin = process_time()
        made = work()
        least = min(least, process_time() - begin)
    return least, made


def numbers() -> Any:
    """The module that has names and numbers of the platform, and the model in which nothing is written out twice."""
    found = importlib.util.spec_from_file_location("hexapod", NUMBERS)
    if found is None or found.loader is None or not NUMBERS.is_file():
        sys.exit(f"expected the platform's numbers in {NUMBERS}")
    module = sys.modules["hexapod"] = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def main() -> None:
    hx = numbers()
    print("| model | parameters | friction | made | printed | pickled and back | written and read | operations |")
    print("|---|---|---|---|---|---|---|---|")
    for variant in (9, 54, 64):
        for friction in ("coulomb", "tanh"):
            forms: dict[str, Callable[[], Any]] = {
                "reformulated": lambda: hx.hexapod(variant, friction),  # noqa: B023
                "textbook": lambda: hexapod(variant, friction, names=False),  # noqa: B023
                "textbook with names": lambda: hexapod(variant, friction),  # noqa: B023
            }
            for name, make in forms.items():
                took, model = seconds(make)
                text = model.to_toml()
                rest = [seconds(of)[0] for of in (lambda: str(make()), lambda: pickle.loads(pickle.dumps(model)))]  # noqa: B023
                read, _ = seconds(lambda: model_from_toml(text))  # noqa: B023
                row = [took, max(rest[0] - took, 0.0), rest[1], read]
                figures = " | ".join(f"{value:.2f} s" for value in row)
                print(f"| {name} | {variant} | {friction} | {figures} | {len(model.structure.programs.rates.stage)} |")


if __name__ == "__main__":
    main()
