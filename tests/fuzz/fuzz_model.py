"""Feeds mutated texts to what reads models: each must be a model or one line that says why not, and soon.

Run ``python tests/fuzz/fuzz_model.py -max_total_time=600`` with atheris installed; it ends at the first crash. Texts are built
from pieces of the language as often as from raw bytes, so that most of them get past the first character.
"""

import sys
import time

import atheris

with atheris.instrument_imports(include=["fisherpoint"]):  # what is imported later, in functions, is not instrumented
    import fisherpoint.models.dependence
    import fisherpoint.models.surfaces.branches
    import fisherpoint.models.symbolic
    import fisherpoint.models.tape.programs
    from fisherpoint.models.equation_text import parse_equation

import sympy

import fisherpoint as fp

SYMBOLS = {name: sympy.Symbol(name, real=True) for name in ("x", "y", "u", "k", "p")}
PIECES = (
    *SYMBOLS,
    *("+", "-", "*", "/", "**", "(", ")", ",", " ", " < ", " >= ", " and ", " or ", "not ", " if ", " else "),
    *("0", "1", "2.5", "1e400", "10**9", "pi", "1" * 40, "(" * 50, "**" * 3, "-" * 30),
    *("sqrt(", "exp(", "log(", "sin(", "atan2(", "abs(", "sign(", "heaviside(", "min(", "max(", "where("),
    *("__import__('os')", ".real", "lambda: 0", "[0]", "{", "}", "'", '"', "=", ";", "#", "\n", "\x00", "\ud800", "é"),
)
SLOW = 5.0
"""Seconds that no text may take."""


def text_of(data: atheris.FuzzedDataProvider) -> str:
    if data.ConsumeBool():
        return data.ConsumeUnicode(200)
    return "".join(PIECES[data.ConsumeIntInRange(0, len(PIECES) - 1)] for _ in range(data.ConsumeIntInRange(0, 40)))


def one_line(error: Exception) -> None:
    assert "\n" not in str(error), error


def test_one(given: bytes) -> None:
    data = atheris.FuzzedDataProvider(given)
    begin = time.perf_counter()
    kind = data.ConsumeIntInRange(0, 3)
    try:
        if kind < 2:
            parse_equation(text_of(data), SYMBOLS, "equations.x")
        elif kind == 2:
            equations = [text_of(data), text_of(data)]
            model = fp.SymbolicModel([equations[0]], [equations[1]], {"x": "m"}, {"u": "V"}, {"k": "1", "p": "1"})
            fp.simulate(model, fp.Experiments([[0.5]], [1.0], [0.1]), {"k": 0.7, "p": 1.3})
        else:
            fp.SymbolicModel(["-k*x"], ["x"], {"x": text_of(data)}, {}, {"k": text_of(data)}, name=text_of(data))
    except ValueError as error:
        one_line(error)
    assert time.perf_counter() - begin < SLOW, "too slow"


if __name__ == "__main__":
    atheris.Setup(sys.argv, test_one)
    atheris.Fuzz()
