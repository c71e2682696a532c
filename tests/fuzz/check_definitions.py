"""Random models with definitions of some of their parts: the same as written out, as read again, and as taken apart once more.

A definition is a term of a text, so that its name may stand wherever the term does, in that text and in others. The same terms
elsewhere are replaced too.
"""

from __future__ import annotations

import ast
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np

import fisherpoint as fp
from check_bits import numbers, same_bits
from checks import Bench
from fisherpoint.models.toml_to_model import model_from_toml
from reading import Floats

MOST = 4  # definitions of a model
ROUNDING = 1e-9  # of the largest number: products of sums are multiplied out in one order or another


def terms_in(tree: ast.expr) -> Iterator[ast.expr]:
    """Parts of a formula that are terms and no names, outer ones first."""
    stack = [(tree, True)]
    while stack:
        node, term = stack.pop()
        if term and isinstance(node, ast.BinOp | ast.UnaryOp | ast.Call):
            yield node
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr) and not (isinstance(node, ast.Call) and child is node.func):
                condition = isinstance(child, ast.Compare | ast.BoolOp) or (
                    isinstance(child, ast.UnaryOp) and isinstance(child.op, ast.Not)
                )
                stack.append((child, not condition))


class _Named(ast.NodeTransformer):
    """Puts a name in place of a term."""

    def __init__(self, term: str, name: str) -> None:
        self.term, self.name = term, name

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.expr) and ast.unparse(node) == self.term:
            return ast.Name(self.name, ast.Load())
        return self.generic_visit(node)


def with_definitions(texts: list[str], rng: np.random.Generator) -> tuple[list[str], dict[str, str]]:
    """Texts with names for some terms, and these as texts, inner ones first."""
    trees = [ast.parse(text, mode="eval").body for text in texts]
    found: dict[str, str] = {}
    for k in range(int(rng.integers(1, MOST + 1))):
        terms = [term for tree in trees for term in terms_in(tree) if any(isinstance(n, ast.Name) for n in ast.walk(term))]
        if not terms:
            break
        term = ast.unparse(terms[int(rng.integers(len(terms)))])
        named = _Named(term, f"e{k + 1}")
        trees = [named.visit(tree) for tree in trees]
        found[f"e{k + 1}"] = term
    return [ast.unparse(tree) for tree in trees], found


def check_definitions(bench: Bench) -> None:
    """The case's model with definitions, and what becomes of it."""
    case, rng = bench.case, np.random.default_rng(bench.case.seed)
    n = len(case.rates)
    texts, definitions = with_definitions([*case.rates, *case.outputs], rng)
    given = case.arguments() | {"f": texts[:n], "g": texts[n:], "definitions": definitions, "check_units": False}
    bench.figures.count("models with definitions")
    named = fp.SymbolicModel(**given)
    bench.figures.count("models with definitions: the same equations", named == bench.model)
    if len(bench.points):
        expected = numbers(bench.model, case, bench.points, bench.theta)
        own = numbers(named, case, bench.points, bench.theta)
        exact = named == bench.model
        compare(bench, "written out", expected, own, exact)
        written = fp.SymbolicModel(**(given | {"f": list(named._written.rates), "g": list(named._written.output)}))
        again = {"pickled": pickle.loads(pickle.dumps(named)), "read": model_from_toml(named.to_toml()), "expressions": written}
        for name, model in again.items():
            compare(bench, name, own, numbers(model, case, bench.points, bench.theta), True)


def compare(bench: Bench, name: str, expected: dict[str, Floats], found: dict[str, Floats], exact: bool) -> None:
    for kind, array in expected.items():
        other = found[kind]
        if same_bits(array, other):
            continue
        near = array.shape == other.shape and bool(
            np.all(np.abs(array - other) <= ROUNDING * (np.abs(array).max(initial=0.0) + 1e-300))
        )
        bench.figures.count(f"models with definitions, {name}: {'close' if near else 'other'} {kind}")
        if exact or not near:
            bench.report(f"definitions change bits: {name}", 1.0, 0, "model", f"{kind} of a model with definitions changes")
