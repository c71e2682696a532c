"""Two tanks whose right-hand side, output and domain are Python functions."""

from __future__ import annotations

from typing import Any

import numpy as np

import fisherpoint as fp

STATES, INPUTS, PARAMETERS, OUTPUTS = {"h1": "m", "h2": "m"}, {"u": "V"}, dict.fromkeys(("k1", "k2", "k3", "k4"), "1"), {"y": "m"}
NOMINAL = {"k1": 0.5, "k2": 0.4, "k3": 0.3, "k4": 0.2}
PRIOR = fp.GaussianPrior(NOMINAL, relative_std=dict.fromkeys(NOMINAL, 0.1))
REGION = fp.ExperimentRegion({"h1": (0.3, 1.0), "h2": (0.3, 1.0), "u": (0.0, 3.0), "dt": (0.5, 2.0)})


def rates(x: Any, u: Any, p: Any) -> Any:
    return [-p.k1 * np.sqrt(x.h1) + p.k4 * u.u, p.k2 * np.sqrt(x.h1) - p.k3 * np.sqrt(x.h2)]


def real_rates(x: Any, u: Any, p: Any) -> Any:
    """Drops the imaginary part without a word."""
    x, p = np.real(np.asarray(x)), np.real(np.asarray(p))
    flow, out = np.sqrt(x[:, 0]), np.sqrt(x[:, 1])
    return np.column_stack([-p[:, 0] * flow + p[:, 3] * u[:, 0], p[:, 1] * flow - p[:, 2] * out])


def level(x: Any, u: Any, p: Any) -> Any:
    return x.h2


def upper(x: Any, u: Any, p: Any) -> Any:
    return x.h1


DOMAIN = {"h1": upper, "h2": level}


def tanks(f: Any = rates, **changes: Any) -> fp.CallableModel:
    arguments: dict[str, Any] = {"domain": DOMAIN, "name": "tanks", "nominal": NOMINAL}
    return fp.CallableModel(f, level, STATES, INPUTS, PARAMETERS, OUTPUTS, **(arguments | changes))
