"""What is known of the parameters before the experiments."""

from __future__ import annotations

from collections.abc import Mapping

from .quantity import FrozenMapping, as_float, check_names


class GaussianPrior:
    """Independent normal distributions, eq. (11) and (12) with a negative exponent.

    Parameters
    ----------
    mean : mapping of parameter name to float
        SI units.
    std : mapping of parameter name to float, optional
        Standard deviations, SI units.
    relative_std : mapping of parameter name to float, optional
        Standard deviations as shares of |mean|; give either this or `std`.

    Raises
    ------
    ValueError
        Where names differ between the mappings, or a standard deviation is not positive and finite.
    """

    def __init__(
        self,
        mean: Mapping[str, float],
        std: Mapping[str, float] | None = None,
        relative_std: Mapping[str, float] | None = None,
    ) -> None:
        if (std is None) == (relative_std is None):
            given = "both" if std is not None else "neither"
            raise ValueError(f"GaussianPrior: expected either std or relative_std, given {given}")
        for label, given_mapping in (("mean", mean), ("std", std), ("relative_std", relative_std)):
            if (given_mapping is not None or label == "mean") and not isinstance(given_mapping, Mapping):
                raise TypeError(f"{label}: expected a mapping of names to numbers, given {type(given_mapping).__name__}")
        means = {name: as_float(value, f"mean[{name!r}]") for name, value in mean.items()}
        if not means:
            raise ValueError("mean: expected at least one parameter, given none")
        spread, label = (std, "std") if std is not None else (relative_std or {}, "relative_std")
        check_names(spread, means, label)
        stds = {}
        for name in means:
            value = as_float(spread[name], f"{label}[{name!r}]")
            stds[name] = value if std is not None else value * abs(means[name])
            if not stds[name] > 0:
                raise ValueError(
                    f"{label}[{name!r}]: expected a positive standard deviation, given {value:g} (mean {means[name]:g})"
                )
        self._mean, self._std = FrozenMapping(means), FrozenMapping(stds)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._mean)

    @property
    def mean(self) -> Mapping[str, float]:
        return self._mean

    @property
    def std(self) -> Mapping[str, float]:
        return self._std

    def __eq__(self, other: object) -> bool:
        return isinstance(other, GaussianPrior) and (self._mean, self._std) == (other._mean, other._std)

    def __hash__(self) -> int:
        return hash((tuple(self._mean.items()), tuple(self._std.items())))

    def __reduce__(self) -> tuple[object, ...]:
        return (GaussianPrior, (dict(self._mean), dict(self._std)))

    def __repr__(self) -> str:
        return f"GaussianPrior(mean={dict(self._mean)!r}, std={dict(self._std)!r})"
