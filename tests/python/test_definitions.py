"""Definitions: named intermediate quantities of equations mean what is written out, and stay with the model wherever it goes."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import fisherpoint as fp
from check_definitions import check_definitions, with_definitions
from checks import Bench
from figures import Figures
from fisherpoint.basics.formulas import MAX_LENGTH
from fisherpoint.models.model_text import LINES, WIDTH
from fisherpoint.models.toml_to_model import model_from_toml
from random_models import Case

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

CAR: dict[str, Any] = {
    "states": {"v": "m/s"},
    "inputs": {"u": "N"},
    "parameters": {"m": "kg", "c": "N s2/m2"},
    "outputs": {"y": "m/s"},
}
DEFINED = {"drag": "c*v*abs(v)", "a": "(u - drag)/m"}


def car(**changes: Any) -> fp.SymbolicModel:
    given: dict[str, Any] = {"f": ["a"], "g": ["v + 0.1*a"], **CAR, "definitions": DEFINED, "name": "car"} | changes
    return fp.SymbolicModel(**given)


def written_out() -> fp.SymbolicModel:
    return car(f=["(u - c*v*abs(v))/m"], g=["v + 0.1*((u - c*v*abs(v))/m)"], definitions=None)


@fp.model(**CAR, name="car")
def by_function(x: Any, u: Any, p: Any) -> Any:
    drag = fp.let("drag", p.c * x.v * abs(x.v))
    a = fp.let("a", (u.u - drag) / p.m)
    return [a], [x.v + 0.1 * a]


POINTS = fp.Experiments([[3.0], [-2.0]], [[5.0], [40.0]], [1.5, 2.0])
THETA = [2.0, 0.7]


def bits(model: Any, theta: Any = THETA) -> list[bytes]:
    done = fp.sensitivities(model, POINTS, theta, threads=1)
    return [array.tobytes() for array in (done.x, done.y, done.dx_dtheta, done.dy_dtheta)]


def test_definitions_mean_what_is_written_out() -> None:
    model = car()
    assert model == by_function == written_out()
    assert hash(model) == hash(written_out())
    assert bits(model) == bits(by_function) == bits(written_out())
    assert dict(model.definitions) == DEFINED
    assert dict(by_function.definitions) == {"drag": "c*v*abs(v)", "a": "(u - drag)/m"}
    assert dict(written_out().definitions) == {}
    assert "drag = c*v*abs(v)\na = (u - drag)/m\n\ndv/dt = a\ny = v + 0.1*a\n" in str(model)
    assert r"drag &= c v \left|{v}\right| \\ a &= \frac{" in model._repr_latex_()


def test_expressions_may_have_names_too() -> None:
    v, u, m, c = sympy.symbols("v u m c")
    drag = fp.let("drag", c * v * sympy.Abs(v))
    assert isinstance(drag, sympy.Symbol)
    rate = (u - drag) / m
    assert car(f=[rate], g=[v + sympy.Float(0.1) * rate], definitions=None) == written_out()
    a, drag = sympy.symbols("a drag")
    given = {"drag": c * v * sympy.Abs(v), "a": (u - drag) / m}
    assert car(f=[a], g=[v + sympy.Float(0.1) * a], definitions=given) == written_out()


def test_surfaces_and_limits_have_the_names() -> None:
    given = {"q": "u - c*v", "r": "sqrt(v - m)"}
    model = car(f=["sign(q)*r"], g=["v/q"], definitions=given, domain=["exp(q) - 2"], check_units=False)
    assert model.jumps == ("q",)
    assert model.domain == ("exp(q) - 2", "v - m")
    assert "q < 3" in model.within("q < 3").domain
    assert car(f=["1 + 0*r + r**2"], definitions=given, g=["v"], check_units=False).domain == ("v - m",)


WRITTEN_OUT: dict[str, tuple[dict[str, str], dict[str, Any], dict[str, Any]]] = {
    "a dead time": ({"w": "delay(u, tau)"}, {"f": ["w/m"]}, {"f": ["delay(u, tau)/m"]}),
    "a late output": ({"w": "delay(v, tau)"}, {"g": ["2*w"]}, {"g": ["2*delay(v, tau)"]}),
    "a latch": ({"on": "latch(v < 1, v > 2)"}, {"f": ["on - c*v"]}, {"f": ["latch(v < 1, v > 2) - c*v"]}),
    "cases": ({"w": "where(v > 1 and u > 0, v, -v)"}, {"f": ["w*c"]}, {"f": ["where(v > 1 and u > 0, v, -v)*c"]}),
    "a condition of a reset": (
        {"h": "v - c"},
        {"resets": {"h < 0": {"v": "m*h"}}},
        {"resets": {"v - c < 0": {"v": "m*(v - c)"}}},
    ),
    "an update": ({"h": "v - c"}, {"resets": {"every 1 s": {"v": "h"}}}, {"resets": {"every 1 s": {"v": "v - c"}}}),
    "the time": ({"ramp": "c*t"}, {"f": ["ramp + u"]}, {"f": ["c*t + u"]}),
    "a name of the time": ({"time": "c*t"}, {"f": ["time + u"]}, {"f": ["c*t + u"]}),
    "a domain that products lose": ({"w": "sqrt(v)"}, {"f": ["w*w"]}, {"f": ["sqrt(v)*sqrt(v)"]}),
    "a domain that differences lose": ({"w": "sqrt(v)"}, {"f": ["u + w - w"]}, {"f": ["u + sqrt(v) - sqrt(v)"]}),
    "a divisor that quotients lose": ({"w": "v - c"}, {"f": ["u + w/w"]}, {"f": ["u + (v - c)/(v - c)"]}),
    "a number": ({"two": "2"}, {"f": ["two*u"]}, {"f": ["2*u"]}),
}


@pytest.mark.parametrize("name", WRITTEN_OUT)
def test_whatever_stands_in_a_definition(name: str) -> None:
    definitions, by_name, out = WRITTEN_OUT[name]
    given: dict[str, Any] = {"f": ["u"], "g": ["v"], "check_units": False, "definitions": None}
    given["parameters"] = {"m": "1", "c": "1", "tau": "s"}
    model, other = car(**(given | by_name | {"definitions": definitions})), car(**(given | out))
    assert model == other
    assert len(model.domain) == len(other.domain) and len(model.poles) == len(other.poles)
    assert model.structure.programs == other.structure.programs
    for again in (model_from_toml(model.to_toml()), pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert again == model and again.definitions == model.definitions
        assert again.structure.programs == model.structure.programs


def test_units_are_seen_through_definitions() -> None:
    with pytest.warns(UserWarning, match=r"units of car: equations\.v: .*m/s"):
        car(f=["a + w"], definitions=DEFINED | {"w": "c*v"})


def test_other_models_keep_the_definitions_and_texts() -> None:
    model = car(f=["  a"], constants={"k": (2.0, "1")})
    for other in (model.fix(c=0.7), model.estimate("k"), model.within("a < 100"), model.within("abs(v) < 50"), copy.copy(model)):
        assert other.definitions == model.definitions and other.texts.rates == ("  a",)
    free = model.free_start("v")
    assert dict(free.definitions) == {"drag": "c*(v + v_0)*abs(v + v_0)", "a": "(u - drag)/m"}
    assert bits(model.fix(c=0.7).estimate("c"), [2.0, 0.7])[:2] == bits(car())[:2]
    x = fp.sensitivities(free, POINTS, [*THETA, 0.0], threads=1)
    assert x.x.tobytes() == bits(model)[0]


def test_a_pickled_model_is_the_same_in_another_process(tmp_path: Path) -> None:
    (tmp_path / "model").write_bytes(pickle.dumps((car(), by_function, POINTS, THETA)))
    code = (
        "import pickle, sys, fisherpoint as fp\n"
        "first, second, points, theta = pickle.load(open(sys.argv[1], 'rb'))\n"
        "for model in (first, second):\n"
        "    done = fp.sensitivities(model, points, theta, threads=1)\n"
        "    print(done.x.tobytes().hex(), done.dx_dtheta.tobytes().hex(), *model.definitions)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "model")], capture_output=True, text=True, check=True)
    own = bits(car())
    assert done.stdout.splitlines() == [f"{own[0].hex()} {own[2].hex()} drag a"] * 2


def made(**definitions: Any) -> Callable[[], Any]:
    return lambda: car(f=["u"], g=["v"], definitions=definitions, check_units=False)


def decorated(function: Callable[..., Any]) -> Callable[[], Any]:
    return lambda: fp.model(**CAR)(function)


MISTAKES: dict[str, Callable[[], Any]] = {
    r"definitions\.a: expected quantities, and definitions that come before it, given itself": made(a="2*a"),
    r"definitions\.a: expected quantities, and definitions that come before it, given b, which is defined after it": made(
        a="b", b="v"
    ),
    r"definitions\.v: expected a name of its own, given one that a quantity has too": made(v="u"),
    r"definitions\.'sin': expected a name that is not in use": made(sin="u"),
    r"definitions\.'2a': expected a name of letters": made(**{"2a": "u"}),
    r"definitions\.a: column 3: expected the names v, u, m, c; given 'q'": made(a="2*q"),
    r"definitions\.a: expected a formula as text|definitions\.a: expected an expression, given None": made(a=None),
    r"definitions: expected a mapping of names to terms, given \['a'\]": lambda: car(definitions=["a"]),
    r"let: expected a term for a, given None": lambda: fp.let("a", None),
    r"let\.'2a': expected a name of letters": lambda: fp.let("2a", 1.0),
    r"let: expected a name as text, given 3": lambda: fp.let(3, 1.0),  # type: ignore[arg-type]
    r"<lambda>, line 1: let: expected a term for a, given the condition .*: write where": decorated(
        lambda x, u, p: ([fp.let("a", x.v > 0)], [x.v])
    ),
    r"definitions\.a: expected one value under a name, given two": decorated(
        lambda x, u, p: ([fp.let("a", x.v) + fp.let("a", u.u)], [x.v])
    ),
    r"definitions\.m: expected a name of its own, given one that a quantity has too": decorated(
        lambda x, u, p: ([fp.let("m", x.v + u.u)], [x.v])
    ),
}


@pytest.mark.parametrize("expected", MISTAKES)
def test_a_mistake_is_one_line_that_names_the_definition(expected: str) -> None:
    with pytest.raises((ValueError, TypeError), match=f"^({expected})") as caught:
        MISTAKES[expected]()
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_a_mistake_in_a_file_names_the_key() -> None:
    with pytest.raises(ValueError, match=r"model\.definitions\.drag: column 3: expected the names v, u, m, c; given 'q'"):
        model_from_toml(car().to_toml().replace("c*v*abs(v)", "c*q"))
    with pytest.raises(ValueError, match=r"model\.definitions: expected only with a table \[model\.equations\], given without"):
        model_from_toml('[model]\nname = "hydraulic_cylinder"\n[model.definitions]\na = "v"\n')


# --- names that a model makes of its own ---------------------------------------------------------------------------------


def shared(depth: int, **parameters: str) -> fp.SymbolicModel:
    """A rate of some hundred operations, which is 2**depth terms long when it is written out."""

    def equations(x: Any, u: Any, p: Any) -> Any:
        z = p.k * x.x
        for _ in range(depth):
            z = fp.math.sin(z) + fp.math.cos(z) / 2
        return [z, u.u - z], [x.x + z]

    states = {"x": "1", "y": "1"}
    return fp.model(states=states, inputs={"u": "1"}, parameters={"k": "1"} | parameters, outputs={"z": "1"}, check_units=False)(
        equations
    )


def test_what_is_used_more_than_once_is_computed_once_and_gets_a_name_where_texts_are_long() -> None:
    model = shared(40)
    assert len(model.structure.programs.rates.stage) < 40 * 5
    texts = (*model.texts.rates, *model.texts.output, *model.definitions.values())
    assert max(map(len, texts)) < 100 and len(model.definitions) <= 45
    assert next(iter(model.definitions)) == "d1"
    lines = str(model).splitlines()
    assert len(lines) <= LINES and max(map(len, lines)) <= WIDTH
    for again in (model_from_toml(model.to_toml()), pickle.loads(pickle.dumps(model))):
        assert again == model and hash(again) == hash(model)
        assert again.structure.programs == model.structure.programs
        assert again.to_toml() == model.to_toml()
    changed = shared(40, q="1")
    assert bool(
        np.isfinite(changed.fix(k=0.5).free_start("x").within("x < 3").estimate("k").rhs([0.1, 0.2], 1.0, [1.0, 0.0, 0.5])).all()
    )


def test_a_long_chain_of_definitions_is_copied_and_read() -> None:
    def equations(x: Any, u: Any, p: Any) -> Any:
        z = x.v
        for i in range(70):
            z = fp.let(f"q{i}", fp.math.exp(-z) * p.c)
        return [z], [x.v]

    model = fp.model(**CAR, check_units=False)(equations)
    assert [*model.definitions] == [f"q{i}" for i in range(70)]
    for again in (pickle.loads(pickle.dumps(model)), model_from_toml(model.to_toml()), model.within("v < 3").fix(m=1.0)):
        assert again.definitions == model.definitions


def test_names_of_its_own_collide_with_nothing() -> None:
    model = shared(12, d1="1", d7="1")
    assert next(iter(model.definitions)) == "dd1"
    assert model_from_toml(model.to_toml()) == model


def test_a_small_model_has_none_and_prints_as_it_is_written() -> None:
    model = shared(3)
    assert not model.definitions and "..." not in str(model)
    assert model_from_toml(model.to_toml()) == model


def test_long_formulas_that_share_nothing_are_cut_too() -> None:
    """Texts that are read have an end, and so have the brackets in them."""
    names = [f"p{i}" for i in range(60)]

    def equations(x: Any, u: Any, p: Any) -> Any:
        rate = sum(fp.math.sin(p[i] * x.x + i) * fp.math.exp(-((x.x - i) ** 2)) for i in range(60) for _ in range(1))
        nested = x.x
        for i in range(60):
            nested = fp.math.sin(nested + p[i])
        longer = [fp.math.tanh(rate * p[i] + nested / (i + 2)) for i in range(60)]
        return [sum(longer) * nested], [x.x]

    model = fp.model(states={"x": "1"}, inputs={}, parameters=dict.fromkeys(names, "1"), outputs={"y": "1"}, check_units=False)(
        equations
    )
    assert max(map(len, (*model.texts.rates, *model.definitions.values()))) < MAX_LENGTH / 2
    assert model_from_toml(model.to_toml()) == model


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_examples_are_the_same_when_written_and_read_and_pickled(path: Path) -> None:
    model = fp.load_problem(path).model if "[prior" in path.read_text() else fp.load_model(path)
    for again in (model_from_toml(model.to_toml()), pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert again == model and str(again) == str(model)
        if isinstance(model, fp.SymbolicModel):
            assert again.structure.programs == model.structure.programs  # type: ignore[attr-defined]
    assert "..." not in str(model)


# --- random models --------------------------------------------------------------------------------------------------------


def test_terms_get_names_wherever_they_stand() -> None:
    texts, found = with_definitions(["sin(x + 1)*k + where(x + 1 > 2, x + 1, 0)"], np.random.default_rng(3))
    assert len(found) > 0 and any(name in texts[0] for name in found)


@pytest.mark.parametrize("seed", range(4))
def test_random_definitions_of_a_model_change_no_bits(seed: int) -> None:
    rates = ("x1*p1*(1 - x1/(p2 + 0.3*x2)) - max(x1 - 0.5, 0)*p2", "sin(x1*p1)*(x1 - x2)*2*u1 - abs(x2 - 0.4)*p1*(x1 - x2)")
    case = Case(
        rates,
        ("x1*(x1 - x2)*2", "sqrt(x2 + 3)*p1"),
        (1.0, 1.0),
        (1.0,),
        (1.0, 0.5),
        relative_std=(0.1, 0.1),
        log=(False, False),
        seed=seed,
    )
    bench = Bench(case, Figures())
    check_definitions(bench)
    assert not bench.findings
