"""How expectations over the prior are taken: rules that turn a prior into weighted nodes."""

from .base import MAX_LOST_WEIGHT, Rule
from .linearized import LinearizedRule
from .sobol import Sobol
from .sparse import SparseGaussHermite, Unscented
from .tensor import GaussHermite, TensorGrid

RULES: dict[str, type[Rule]] = {
    "tensor_grid": TensorGrid,
    "gauss_hermite": GaussHermite,
    "sparse_gauss_hermite": SparseGaussHermite,
    "sobol": Sobol,
    "unscented": Unscented,
    "linearized": LinearizedRule,
}
"""The rules by the names that files call them."""

DEFAULT_RULE = SparseGaussHermite(2)
"""The cheapest rule whose error is about 1 % at the 90th percentile of the points measured: docs/explanation/quadrature.md."""

__all__ = [
    "DEFAULT_RULE",
    "MAX_LOST_WEIGHT",
    "RULES",
    "GaussHermite",
    "LinearizedRule",
    "Rule",
    "Sobol",
    "SparseGaussHermite",
    "TensorGrid",
    "Unscented",
]
