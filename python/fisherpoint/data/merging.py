"""Channels that were sampled at different times, as one record."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..basics.checks import as_numbers, check_known, check_mapping
from ..basics.messages import shown, stacklevel_of_user
from ..basics.moments import in_seconds
from ..basics.quantity import names_of
from ..basics.values import Array
from ..models import Model
from .held_inputs import checked_times

Channel = tuple[NDArray[Any], Array]
"""Times and numbers of the samples that are there."""


def merged_channels(channels: Mapping[str, tuple[ArrayLike, ArrayLike]], model: Model) -> tuple[Array, Array, Array]:
    """t (N,), u (N, n_u) and y (N, n_y) of the samples of all channels; see `Record.merged`."""
    inputs, outputs = names_of(model.inputs), names_of(model.outputs)
    columns = {f"y_{name}": j for j, name in enumerate(outputs)}
    columns |= {name: j for j, name in enumerate(outputs) if name not in inputs}
    check_known(check_mapping(channels, "channels", "times and numbers"), (*inputs, *columns), "channels")
    for name in inputs:
        if name not in channels:
            raise ValueError(f"channels: expected the samples of the input {name}, given none")
    samples = _on_one_clock({name: _samples(pair, f"channels[{shown(name)}]") for name, pair in channels.items()})
    begin = max((samples[name][0][0] for name in inputs), default=-np.inf)
    t = np.unique(np.concatenate([times for times, _ in samples.values()]))
    t = t[t >= begin]
    u = np.empty((len(t), len(inputs)))
    for i, name in enumerate(inputs):
        times, values = samples[name]
        u[:, i] = values[np.searchsorted(times, t, side="right") - 1]
    y, early = np.full((len(t), len(outputs)), np.nan), 0
    for name in (name for name in samples if name not in inputs):
        times, values = samples[name]
        known = times >= begin
        y[np.searchsorted(t, times[known]), columns[name]] = values[known]
        early += int(np.count_nonzero(~known))
    if np.isnan(y).all():
        raise ValueError(f"channels: expected a measured output from {begin:g} s on, where all inputs are known; given none")
    if early:
        warnings.warn(
            f"channels: left out {early} numbers of outputs before {begin:g} s, where not all inputs are known",
            stacklevel=stacklevel_of_user(),
        )
    return t, u, y


def _samples(pair: Any, name: str) -> Channel:
    """The samples of a channel that are numbers."""
    try:
        times, given = pair
        times = np.asarray(times)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected a pair of times and numbers, given {shown(pair)}") from error
    values = as_numbers(given, name)
    if values.ndim != 1 or values.shape != times.shape:
        raise ValueError(f"{name}: expected as many numbers as times, given shapes {times.shape} and {values.shape}")
    if np.isinf(values).any():
        raise ValueError(f"{name}: expected finite numbers, or NaN where there is no sample; given infinite ones")
    there = ~np.isnan(values)
    if not there.any():
        raise ValueError(f"{name}: expected at least one number, given none")
    return times[there], values[there]


def _on_one_clock(samples: Mapping[str, Channel]) -> dict[str, Channel]:
    """The samples with times in s, of dates those since the first of all channels."""
    kinds = {name: times.dtype.kind for name, (times, _) in samples.items()}
    if "M" in kinds.values():
        for name in (name for name, kind in kinds.items() if kind != "M"):
            raise ValueError(f"channels[{shown(name)}]: expected dates, as other channels have, given other times")
        first = min(times.astype("M8[ns]").min() for times, _ in samples.values())
        samples = {name: (times.astype("M8[ns]") - first, values) for name, (times, values) in samples.items()}
    return {
        name: (
            checked_times(in_seconds(times.astype("m8[ns]")) if times.dtype.kind == "m" else times, f"channels[{shown(name)}]: t"),
            values,
        )
        for name, (times, values) in samples.items()
    }
