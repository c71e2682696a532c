"""Parameters that take the other sign than their mean somewhere over the prior."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..basics.quantity import names_of
from ..basics.values import Array
from ..models import Model
from ..prior.gaussian import GaussianPrior
from ..prior.rules import Rule


def of_other_sign(
    model: Model, prior: GaussianPrior, rule: Rule, varied: Sequence[str], scenarios: Iterable[Array] = ()
) -> list[str]:
    """The names of those, at a node of the rule or in a scenario (p,)."""
    found = []
    everywhere = np.array(list(scenarios)).reshape(-1, len(model.parameters))
    for i, name in enumerate(names_of(model.parameters)):
        if name in prior.log or name not in varied:
            continue
        values = everywhere[:, i]
        try:
            values = np.append(values, rule.nodes(prior.marginal([name]))[0])
        except ValueError:  # a rule that says for other parameters too what it does
            values = np.append(values, prior.mean[name] + np.array([-1.0, 1.0]) * prior.std[name])
        if (values * prior.mean[name] < 0).any():
            found.append(name)
    return found
