"""A fit as the prior of what comes next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..basics.messages import listed
from ..basics.quantity import names_of
from ..prior.gaussian import GaussianPrior
from .statistics import FitStatistics


def posterior_of(fit: FitStatistics) -> GaussianPrior:
    """The normal distribution of the estimate over all parameters of the model; see `Fit.posterior`."""
    fit = replace(fit, weighted=replace(fit.weighted, unknowns=fit.weighted.unknowns.without_bounds(fit.parameters)))
    unknowns, names = fit.weighted.unknowns, names_of(fit.model.parameters)
    common = [name in fit.common for name in unknowns.names]
    if not fit.precision.determined[common].all():
        raise ValueError(
            f"posterior: expected data that determine every parameter, given none on: {'; '.join(fit.null_directions)}"
        )
    estimated = [name for name in names if name in unknowns.names]
    missing = [name for name in names if name not in estimated and (fit.prior is None or name not in fit.prior.names)]
    if missing:
        raise ValueError(f"posterior: expected a prior for the parameters that were not estimated, given none of {listed(missing)}")
    p = len(names)
    mean, covariance, log = fit.theta.copy(), np.zeros((p, p)), np.zeros(p, dtype=bool)
    kept = [names.index(name) for name in names if name not in estimated]
    if kept and fit.prior is not None:
        others = fit.prior.marginal([names[i] for i in kept])
        covariance[np.ix_(kept, kept)] = others.covariance
        mean[kept] = list(others.mean.values())
        log[kept] = [names[i] in others.log for i in kept]

    rows = [unknowns.names.index(name) for name in estimated]
    places = [names.index(name) for name in estimated]
    normal = fit.precision.covariance[np.ix_(rows, rows)] * np.outer(unknowns.scale[rows], unknowns.scale[rows])
    is_log = unknowns.log[rows]
    # The moments of exponentials of normal variables: mean exp(mu + s^2/2), covariances m_i m_j (exp(c_ij) - 1) and m_i c_ij.
    mean[places] *= np.where(is_log, np.exp(np.where(is_log, np.diag(normal), 0.0) / 2), 1.0)
    factor = np.where(is_log, mean[places], 1.0)
    both = np.outer(is_log, is_log)
    covariance[np.ix_(places, places)] = np.where(both, np.expm1(np.where(both, normal, 0.0)), normal) * np.outer(factor, factor)
    log[places] = is_log
    return GaussianPrior(
        dict(zip(names, mean.tolist(), strict=True)),
        covariance=covariance,
        log=[name for name, exponential in zip(names, log, strict=True) if exponential],
    )
