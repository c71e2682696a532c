"""Gaussian and log-normal priors of the parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..basics.checks import (
    LARGEST_STD,
    as_float,
    as_floats_of_shape,
    as_sequence,
    as_share,
    as_std,
    by_name,
    check_known,
    names_among,
)
from ..basics.messages import listed
from ..basics.values import Array, FrozenMapping

SINGULAR = 1e-12
"""Smallest eigenvalue of a correlation matrix up to which it counts as singular."""

MOST_RELATIVE_STD = 3.0
"""Share of a mean above which a percentage was meant; `std` takes any."""

WIDEST = 1e100
"""Standard deviation of a log-normal parameter over its mean."""


class GaussianPrior:
    """Normal distributions, eq. (11) and (12) with a negative exponent; on request correlated, or log-normal.

    Parameters
    ----------
    mean : mapping of parameter name to float
        SI units.
    std : mapping of parameter name to float, optional
        Standard deviations, SI units.
    relative_std : mapping of parameter name to float, optional
        Standard deviations as shares of |mean|, 0.2 for 20 %; of at most 3, `std` takes more.
    covariance : array_like, (p, p), optional
        Covariance matrix in the order of the mean's names, in products of SI units, symmetric and positive definite. Give one of
        `std`, `relative_std` and this.
    log : iterable of str, optional
        Names of parameters that can only be positive: their logarithms are the normal ones. `mean`, `std` and `covariance` remain
        those of the parameter itself.

    Raises
    ------
    ValueError
        Where names differ between the mappings, a standard deviation is not positive and finite, the covariance is no covariance
        matrix, the mean of a log-normal parameter is not positive, or log-normal parameters cannot have this covariance.
    """

    def __init__(
        self,
        mean: Mapping[str, float],
        std: Mapping[str, float] | None = None,
        *,
        relative_std: Mapping[str, float] | None = None,
        covariance: ArrayLike | None = None,
        log: Iterable[str] = (),
    ) -> None:
        spreads = {"std": std, "relative_std": relative_std, "covariance": covariance}
        given = [label for label, spread in spreads.items() if spread is not None]
        if not given or given == ["std", "relative_std"]:
            which = "both" if given else "neither, nor a covariance"
            raise ValueError(f"GaussianPrior: expected either std or relative_std, given {which}")
        if len(given) > 1:
            raise ValueError(f"covariance: expected no {' or '.join(given[:-1])} beside it, given both")
        means = by_name(mean, None, "mean", as_float)
        if not means:
            raise ValueError("mean: expected at least one parameter, given none")
        for name, value in means.items():
            if abs(value) > LARGEST_STD:
                raise ValueError(f"mean[{name!r}]: expected a number of at most {LARGEST_STD:g}, given {value:g}")
        self._mean = means
        self._covariance = None if covariance is None else _checked_covariance(covariance, tuple(means))
        if self._covariance is None:
            if std is not None:
                stds = by_name(std, means, "std", as_std, complete=True)
            else:
                shares = by_name(relative_std, means, "relative_std", as_float, complete=True)
                for name in (name for name in shares if means[name] == 0):
                    raise ValueError(f"relative_std[{name!r}]: expected std in its place, as the mean is 0; given {shares[name]:g}")
                checked = {name: as_share(share, f"relative_std[{name!r}]", MOST_RELATIVE_STD) for name, share in shares.items()}
                stds = FrozenMapping(
                    {
                        name: as_std(share * abs(means[name]), f"relative_std[{name!r}] of the mean {means[name]:g}")
                        for name, share in checked.items()
                    }
                )
            self._correlation = np.eye(len(means))
        else:
            stds = FrozenMapping(dict(zip(means, np.sqrt(np.diag(self._covariance)).tolist(), strict=True)))
            self._correlation = _correlation(self._covariance)
        self._std = stds
        self._log = names_among(log, tuple(means), "log")
        for name in self._log:
            if not means[name] > 0:
                raise ValueError(f"log: expected a positive mean of {name!r}, given {means[name]:g}")
            if stds[name] > WIDEST * means[name]:
                raise ValueError(
                    f"log: expected a standard deviation of {name!r} of at most {WIDEST:g} times its mean {means[name]:g}, "
                    f"given {stds[name]:g}"
                )
        self._normal_std, self._normal_correlation = _normal_moments(self)
        for array in (self._correlation, self._normal_std, self._normal_correlation):
            array.flags.writeable = False

    def _arguments(self) -> dict[str, Any]:
        spread = {"std": None, "covariance": self.covariance} if self.correlated else {"std": self.std, "covariance": None}
        return {"mean": self.mean, **spread, "relative_std": None, "log": self.log}

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._mean)

    @property
    def mean(self) -> Mapping[str, float]:
        return self._mean

    @property
    def std(self) -> Mapping[str, float]:
        return self._std

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters in the order of `names`, (p, p), in products of SI units."""
        if self._covariance is not None:
            return self._covariance.copy()
        return np.diag(np.square(list(self._std.values())))

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters in the order of `names`, (p, p); read-only."""
        return self._correlation

    @property
    def log(self) -> tuple[str, ...]:
        """Names of the log-normal parameters."""
        return self._log

    @property
    def correlated(self) -> bool:
        """Whether any two parameters are."""
        return bool(np.any(self._correlation != np.eye(len(self._correlation))))

    @property
    def normal_std(self) -> Array:
        """Standard deviations (p,) of the normal variables: the parameters, but the logarithms of the log-normal ones."""
        return self._normal_std

    @property
    def normal_correlation(self) -> Array:
        """Correlation (p, p) of the normal variables; read-only."""
        return self._normal_correlation

    def marginal(self, names: Iterable[str]) -> GaussianPrior:
        """Return the joint distribution of some of the parameters, in the given order."""
        names = as_sequence(names, "names", "names")
        check_known(names, self.names, "names")
        if len(set(names)) != len(names) or not names:
            raise ValueError(f"names: expected each name once, at least one, given {listed(names)}")
        mean, log = {name: self._mean[name] for name in names}, [name for name in names if name in self._log]
        if self._covariance is None:
            return GaussianPrior(mean, {name: self._std[name] for name in names}, log=log)
        rows = [self.names.index(name) for name in names]
        return GaussianPrior(mean, covariance=self._covariance[np.ix_(rows, rows)], log=log)

    def moved_to(self, mean: Mapping[str, float]) -> GaussianPrior:
        """Return the same distribution about another mean."""
        if self._covariance is None:
            return GaussianPrior(mean, self._std, log=self._log)
        return GaussianPrior(mean, covariance=self._covariance, log=self._log)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, GaussianPrior) or (self._mean, self._std) != (other._mean, other._std):
            return False
        rows = [other.names.index(name) for name in self.names]
        return set(self._log) == set(other._log) and np.array_equal(self._correlation, other._correlation[np.ix_(rows, rows)])

    def __hash__(self) -> int:
        return hash((self._mean, self._std, frozenset(self._log)))

    def __reduce__(self) -> tuple[object, ...]:
        std = dict(self._std) if self._covariance is None else None
        return partial(GaussianPrior, dict(self._mean), std, covariance=self._covariance, log=self._log), ()

    def __repr__(self) -> str:
        spread = f"std={dict(self._std)!r}" if self._covariance is None else f"covariance={self._covariance.tolist()!r}"
        log = f", log={list(self._log)!r}" if self._log else ""
        return f"GaussianPrior(mean={dict(self._mean)!r}, {spread}{log})"


def _checked_covariance(given: ArrayLike, names: tuple[str, ...]) -> Array:
    """A covariance matrix, made symmetric to the last bit."""
    matrix = as_floats_of_shape(given, (len(names), len(names)), "covariance")
    for name, variance in zip(names, np.diag(matrix), strict=True):
        if not variance > 0:
            raise ValueError(f"covariance: expected a positive variance of {name!r}, given {variance:g}")
        as_std(np.sqrt(variance), f"covariance of {name!r}")
    correlation = _correlation(matrix)
    i, j = np.unravel_index(np.argmax(np.abs(correlation - correlation.T)), correlation.shape)
    if abs(correlation[i, j] - correlation[j, i]) > 1e-9:
        raise ValueError(
            f"covariance: expected a symmetric matrix, given {matrix[i, j]:g} for {names[i]!r} with {names[j]!r} and "
            f"{matrix[j, i]:g} for the reverse"
        )
    symmetric = (matrix + matrix.T) / 2
    _check_definite(symmetric, names, "covariance: expected a positive definite matrix")
    return symmetric


def _normal_moments(prior: GaussianPrior) -> tuple[Array, Array]:
    """Match the moments: ln(1 + C_ij / (m_i m_j)) for two log-normal parameters, C_ij / m_j for a normal and a log-normal one."""
    names, std = prior.names, np.array(list(prior.std.values()))
    if not prior.log:
        return std, prior.correlation.copy()
    is_log, mean = np.array([name in prior.log for name in names]), np.array(list(prior.mean.values()))
    relative = np.divide(std, mean, out=np.ones_like(std), where=is_log)  # normal ones in units of their std
    covariance, both = prior.correlation * np.outer(relative, relative), np.outer(is_log, is_log)
    if (covariance[both] <= -1).any():
        i, j = np.argwhere(both & (covariance <= -1))[0]
        raise ValueError(
            f"log: expected a covariance of {names[i]!r} and {names[j]!r} above minus the product of their means, which log-normal "
            f"parameters cannot fall below; given {covariance[i, j]:g} of it"
        )
    normal: Array = np.where(both, np.log1p(np.where(both, covariance, 0.0)), covariance)
    _check_definite(normal, names, "log: expected parameters whose logarithms can have the given covariance")
    return np.where(is_log, np.sqrt(np.diag(normal)), std), _correlation(normal)


def _check_definite(matrix: Array, names: tuple[str, ...], expected: str) -> None:
    values, vectors = np.linalg.eigh(_correlation(matrix))
    if not values[0] > SINGULAR:
        involved = [name for name, component in zip(names, vectors[:, 0], strict=True) if abs(component) > 0.1]
        raise ValueError(
            f"{expected}, given one that is not positive definite (smallest eigenvalue of the correlation {values[0]:.3g}, "
            f"in {', '.join(involved)})"
        )


def _correlation(covariance: Array) -> Array:
    std = np.sqrt(np.diag(covariance))
    correlation: Array = covariance / np.outer(std, std)
    np.fill_diagonal(correlation, 1.0)
    return correlation
