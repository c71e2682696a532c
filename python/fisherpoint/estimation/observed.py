"""Response of a model to data: predicted outputs and their derivatives by every unknown, for many sets of unknowns at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..basics.quantity import names_of
from ..basics.values import Array
from ..data.measurements import Measurements
from ..models import Model
from ..points.parameter_checks import sensible
from ..points.runs import Runs
from ..points.settings import Integration, checked_arguments
from ..points.status import Status
from .local_unknowns import LocalUnknowns
from .response import RecordResponse, Response, response_of_runs

EPSILON = float(np.finfo(np.float64).eps)


def check_outputs(part: Any, model: Model) -> None:
    """Raise where measurements or a record do not have the model's outputs."""
    if part.samples.shape[1] != len(model.outputs):
        axes = "K, N" if part.y.ndim == 3 else "N"
        raise ValueError(f"y: expected shape ({axes}, {len(model.outputs)}) for the outputs of {model.name}, given {part.y.shape}")


class Observed:
    """Data of a model as N samples in a row, and the response to the unknowns that they depend on.

    Parameters
    ----------
    model : Model
    data : sequence of Measurements or Record
    parameters : tuple of str
        Parameters to estimate.
    theta : ndarray, (p,)
        All parameters; those that are not estimated stay there.
    rtol : float
    threads : int
    local : LocalUnknowns, optional
        Parameters with a value for each group of the data.

    Attributes
    ----------
    names : tuple of str
        The unknowns: the parameters, then starts of records that are not known, as "x0_h1", of the second record "x0_h1_2"; then
        means and values of local parameters.
    common : int
        How many of these come before the values of local parameters.
    starts : mapping of str to (str, Record)
        Of the unknowns that are starts: the state, and the record.
    y : ndarray, (N, n_y)
        Measured outputs, NaN where there are none.
    rtol : float

    Raises
    ------
    ValueError
        Where two unknowns would have the same name.
    """

    def __init__(
        self,
        model: Model,
        data: Sequence[Any],
        parameters: tuple[str, ...],
        theta: Array,
        rtol: float,
        threads: int,
        local: LocalUnknowns | None = None,
    ) -> None:
        self.model, self.rtol, self._theta = model, rtol, theta
        self.local = LocalUnknowns.of({}, data) if local is None else local
        self._given = (model, tuple(data), parameters, theta, rtol, threads)
        self._columns = [names_of(model.parameters).index(name) for name in parameters]
        self._local_columns = [names_of(model.parameters).index(name) for name in self.local.local]
        columns = self._columns + self._local_columns
        self.y = np.concatenate([part.samples for part in data])
        names, self._parts = list(parameters), []
        self.starts: dict[str, tuple[str, Any]] = {}
        for part, places in zip(data, self.local.trajectories, strict=True):
            if isinstance(part, Measurements):
                settings = checked_arguments(model, part.points, theta, rtol, threads, "cross", "cross", None)
                respond = _runs_response(model, part.runs, columns, settings, places)
                self._parts.append((respond, len(part.samples), slice(0)))
                continue
            respond, starts = _record_response(model, part, columns, rtol, threads)
            number = sum(not isinstance(other, Measurements) for other in data[: len(self._parts) + 1])
            first = len(names)
            of_part = {f"x0_{state}" + (f"_{number}" if number > 1 else ""): (state, part) for state in starts}
            for name in (name for name in of_part if name in (*names_of(model.parameters), *names)):
                raise ValueError(f"states: expected different names for the starts of records, given two called {name!r}")
            self.starts |= of_part
            names += of_part
            self._parts.append((respond, len(part), slice(first, len(names))))
        self.common = len(names) + len(self.local.means)
        self.names = (*names, *self.local.means, *self.local.names)
        self.heard: Callable[[int], None] | None = None  # gets the number of sets of unknowns that have a response

    def with_threads(self, threads: int) -> Observed:
        """Return this, computed by so many threads."""
        return Observed(*self._given[:-1], threads, self.local)

    def __reduce__(self) -> tuple[Any, ...]:
        return Observed, (*self._given, self.local)

    @property
    def precision(self) -> float:
        """Share of an output to which the response is computed: of the trajectories' tolerance, or of a double without states."""
        return self.rtol if self.model.states else EPSILON

    def parameters(self, values: Array) -> Array:
        """All parameters (B, p) of the model at the unknowns (B, P), local ones at their mean."""
        theta = np.tile(self._theta, (len(values), 1))
        theta[:, self._columns] = values[:, : len(self._columns)]
        for name in self.local.means:
            theta[:, names_of(self.model.parameters).index(name)] = values[:, self.names.index(name)]
        return theta

    def of_mean(self, values: Array, name: str) -> float:
        """The mean of a local parameter at unknowns (P,)."""
        return float(self.parameters(values[None])[0, names_of(self.model.parameters).index(name)])

    def of_sample(self, values: Array, sample: int) -> Array:
        """All parameters (p,) of the model at a sample."""
        theta: Array = self.parameters(values[None])[0]
        theta[self._local_columns] = values[self.common :][self.local.samples[sample]]
        return theta

    def of_trajectories(self, values: Array) -> list[Array]:
        """All parameters (B, K, p) for the K points, runs or records of each set of data."""
        theta, own = self.parameters(values), values[:, self.common :]
        found = []
        for places in self.local.trajectories:
            of_set = np.repeat(theta[:, None], len(places), axis=1)
            of_set[:, :, self._local_columns] = own[:, places]
            found.append(of_set)
        return found

    def of_sets(self, values: Array) -> list[Array]:
        """All parameters of each set of data at one set of unknowns (1, P): (p,), or (K, p) where there are local ones."""
        if not self.local.each:
            return [self.parameters(values)[0]] * len(self._parts)
        return [theta[0] for theta in self.of_trajectories(values)]

    def respond(self, values: Array) -> Response:
        """The response to unknowns (B, P) in SI units; a set at which the model makes no sense has `Status.not_finite`.

        Its derivatives are by the common unknowns and then, behind these, by the local parameters: of each sample by its own
        values.
        """
        count, p, q = len(values), len(self._columns), len(self._local_columns)
        n_samples, n_y = self.y.shape
        y, dy = np.zeros((count, n_samples, n_y)), np.zeros((count, n_samples, n_y, self.common + q))
        thetas = self.of_trajectories(values) if q else [self.parameters(values)] * len(self._parts)
        sense = [
            sensible(self.model, one.reshape(-1, one.shape[-1])).reshape(count, -1).all(axis=1)
            for one in thetas[: None if q else 1]
        ]
        status = np.where(np.all(sense, axis=0), Status.ok, Status.not_finite).astype(np.int32)
        first = 0
        for theta, (respond, length, starts) in zip(thetas, self._parts, strict=True):
            rows = np.flatnonzero(status == Status.ok)
            if not len(rows):
                break
            part = respond(theta[rows], values[rows, starts])
            samples = slice(first, first + length)
            y[rows, samples] = part.y
            dy[rows, samples, :, :p] = part.dy[..., :p]
            dy[rows, samples, :, self.common :] = part.dy[..., p : p + q]
            dy[rows, samples, :, starts] = part.dy[..., p + q :]
            status[rows] = part.status
            first += length
        finite = np.isfinite(y).all(axis=(1, 2)) & np.isfinite(dy).all(axis=(1, 2, 3))
        status[(status == Status.ok) & ~finite] = Status.not_finite
        failed = status != Status.ok
        y[failed], dy[failed] = 0.0, 0.0
        if self.heard is not None:
            self.heard(count)
        return Response(y, dy, status)


_Respond = Callable[[Array, Array], Response]


def _runs_response(model: Model, runs: Runs, columns: list[int], settings: Integration, places: NDArray[np.intp]) -> _Respond:
    """The response of runs; replicates with the same local parameters are simulated once."""
    _, alike = runs.distinct()
    _, first, replicate = np.unique(np.column_stack([alike, places]), axis=0, return_index=True, return_inverse=True)
    distinct = runs[first]
    number = np.split(np.arange(distinct.measured.sum()), np.cumsum(distinct.measured.sum(axis=1))[:-1])
    order = np.concatenate([number[k] for k in replicate.ravel()])

    def respond(theta: Array, _: Array) -> Response:
        own = theta if theta.ndim == 2 else theta[:, first]
        found = response_of_runs(model, distinct, own, columns, settings)
        return Response(found.y[:, order], found.dy[:, order], found.status)

    return respond


def _record_response(model: Model, record: Any, columns: list[int], rtol: float, threads: int) -> tuple[_Respond, tuple[str, ...]]:
    response = RecordResponse(model, record, columns, rtol, threads)
    known = np.array([(record.x0 or {}).get(name, 0.0) for name in names_of(model.states)])
    places = [names_of(model.states).index(name) for name in response.starts]

    def respond(theta: Array, starts: Array) -> Response:
        x0 = np.tile(known, (len(theta), 1))
        x0[:, places] = starts
        return response(theta if theta.ndim == 2 else theta[:, 0], x0)

    return respond, response.starts
