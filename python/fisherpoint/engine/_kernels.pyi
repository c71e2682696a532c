from __future__ import annotations
import fisherpoint.engine._core
import numpy
import numpy.typing
import typing

__all__: list[str] = [
    "determinant_gains",
    "divided",
    "predictive_covariance",
    "run_sensitivities",
    "sensitivities",
    "simulate",
    "simulate_runs",
]

def determinant_gains(
    factor: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    columns: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
) -> numpy.typing.NDArray[numpy.float64]:
    """
    det(F + W W^T) / det F (N,) of columns (p, n, N), with F = L L^T.
    """

def divided(
    factor: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    columns: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
) -> numpy.typing.NDArray[numpy.float64]:
    """
    L^-1 W of columns (p, n, N), side by side; L (p, p) is a lower triangle.
    """

@typing.overload
def predictive_covariance(
    model: fisherpoint.engine._core.HydraulicCylinder,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    nodes: fisherpoint.engine._core.PriorNodes,
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    max_lost: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    keep_outputs: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.int64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
]:
    """
    Predictive covariances, statuses, nodes for which the planned steps did not do, outputs (K, R, n_y) where kept, and the lost shares of the absolute weight.
    """

@typing.overload
def predictive_covariance(
    model: fisherpoint.engine._core.CompiledModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    nodes: fisherpoint.engine._core.PriorNodes,
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    max_lost: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    keep_outputs: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.int64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
]:
    """
    Predictive covariances, statuses, nodes for which the planned steps did not do, outputs (K, R, n_y) where kept, and the lost shares of the absolute weight.
    """

@typing.overload
def predictive_covariance(
    model: fisherpoint.engine._core.TapeModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    nodes: fisherpoint.engine._core.PriorNodes,
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    max_lost: typing.SupportsFloat | typing.SupportsIndex = 0.0,
    keep_outputs: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.int64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
]:
    """
    Predictive covariances, statuses, nodes for which the planned steps did not do, outputs (K, R, n_y) where kept, and the lost shares of the absolute weight.
    """

@typing.overload
def run_sensitivities(
    model: fisherpoint.engine._core.HydraulicCylinder,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    measured: typing.Annotated[numpy.typing.ArrayLike, numpy.bool],
    s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    outputs_alone: bool = False,
    doubts: bool = False,
    moved: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
    moved_u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = ...,
    updates: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
    whole_first: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.int64],
]:
    """
    x, y, dx_dtheta, dy_dtheta at the segments' ends, statuses, segments that were completed. s is dx_dtheta at the starts, empty for zero; at an end that is not `measured` no derivative need exist. With `doubts`, entries of dx_dtheta are NaN that hang on whether a jump is met before an end or behind it. At the start of a segment the input may switch in instants that are parameters: moved (K, N, E) has their columns, -1 for none, and moved_u (K, N, E, n_u) the inputs before. updates are as of simulate_runs.
    """

@typing.overload
def run_sensitivities(
    model: fisherpoint.engine._core.CompiledModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    measured: typing.Annotated[numpy.typing.ArrayLike, numpy.bool],
    s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    outputs_alone: bool = False,
    doubts: bool = False,
    moved: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
    moved_u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = ...,
    updates: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
    whole_first: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.int64],
]:
    """
    x, y, dx_dtheta, dy_dtheta at the segments' ends, statuses, segments that were completed. s is dx_dtheta at the starts, empty for zero; at an end that is not `measured` no derivative need exist. With `doubts`, entries of dx_dtheta are NaN that hang on whether a jump is met before an end or behind it. At the start of a segment the input may switch in instants that are parameters: moved (K, N, E) has their columns, -1 for none, and moved_u (K, N, E, n_u) the inputs before. updates are as of simulate_runs.
    """

@typing.overload
def run_sensitivities(
    model: fisherpoint.engine._core.TapeModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    measured: typing.Annotated[numpy.typing.ArrayLike, numpy.bool],
    s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    outputs_alone: bool = False,
    doubts: bool = False,
    moved: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
    moved_u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = ...,
    updates: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
    whole_first: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.int64],
]:
    """
    x, y, dx_dtheta, dy_dtheta at the segments' ends, statuses, segments that were completed. s is dx_dtheta at the starts, empty for zero; at an end that is not `measured` no derivative need exist. With `doubts`, entries of dx_dtheta are NaN that hang on whether a jump is met before an end or behind it. At the start of a segment the input may switch in instants that are parameters: moved (K, N, E) has their columns, -1 for none, and moved_u (K, N, E, n_u) the inputs before. updates are as of simulate_runs.
    """

@typing.overload
def sensitivities(
    model: fisherpoint.engine._core.HydraulicCylinder,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    whole_first: bool = False,
    outputs_alone: bool = False,
    states_later: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
]:
    """
    x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time; with `states_later` none where that takes less time, and the statuses of those that have one.
    """

@typing.overload
def sensitivities(
    model: fisherpoint.engine._core.CompiledModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    whole_first: bool = False,
    outputs_alone: bool = False,
    states_later: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
]:
    """
    x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time; with `states_later` none where that takes less time, and the statuses of those that have one.
    """

@typing.overload
def sensitivities(
    model: fisherpoint.engine._core.TapeModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    whole_first: bool = False,
    outputs_alone: bool = False,
    states_later: bool = False,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
]:
    """
    x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time; with `states_later` none where that takes less time, and the statuses of those that have one.
    """

@typing.overload
def simulate(
    model: fisherpoint.engine._core.HydraulicCylinder,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.float64],
]:
    """
    x, y, statuses, and until when the trajectories could be followed.
    """

@typing.overload
def simulate(
    model: fisherpoint.engine._core.CompiledModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.float64],
]:
    """
    x, y, statuses, and until when the trajectories could be followed.
    """

@typing.overload
def simulate(
    model: fisherpoint.engine._core.TapeModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
    numpy.typing.NDArray[numpy.float64],
]:
    """
    x, y, statuses, and until when the trajectories could be followed.
    """

@typing.overload
def simulate_runs(
    model: fisherpoint.engine._core.HydraulicCylinder,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    updates: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64]]:
    """
    States (K, N + 1, n_x) of runs with the starts x0 (K, n_x) under the inputs u (K, N, n_u), each held for its dt (K, N), or of u (N, n_u) and dt (N,) that all share; statuses, and how many segments were completed. updates, as dt: those of the model that come at the segments' starts, as bits.
    """

@typing.overload
def simulate_runs(
    model: fisherpoint.engine._core.CompiledModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    updates: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64]]:
    """
    States (K, N + 1, n_x) of runs with the starts x0 (K, n_x) under the inputs u (K, N, n_u), each held for its dt (K, N), or of u (N, n_u) and dt (N,) that all share; statuses, and how many segments were completed. updates, as dt: those of the model that come at the segments' starts, as bits.
    """

@typing.overload
def simulate_runs(
    model: fisherpoint.engine._core.TapeModel,
    x0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    dt: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    rtol: typing.SupportsFloat | typing.SupportsIndex,
    cross_kinks: bool,
    cross_jumps: bool,
    method: str,
    threads: typing.SupportsInt | typing.SupportsIndex,
    updates: typing.Annotated[numpy.typing.ArrayLike, numpy.int32] = ...,
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64]]:
    """
    States (K, N + 1, n_x) of runs with the starts x0 (K, n_x) under the inputs u (K, N, n_u), each held for its dt (K, N), or of u (N, n_u) and dt (N,) that all share; statuses, and how many segments were completed. updates, as dt: those of the model that come at the segments' starts, as bits.
    """
