from __future__ import annotations
import fisherpoint.engine._core
import numpy
import numpy.typing
import typing

__all__: list[str] = ["predictive_covariance", "sensitivities", "simulate", "simulate_records"]

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
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
]:
    """
    x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time.
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
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
]:
    """
    x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time.
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
) -> tuple[
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.float64],
    numpy.typing.NDArray[numpy.int32],
]:
    """
    x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time.
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
    numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32]
]: ...
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
    numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32]
]: ...
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
    numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32]
]: ...
@typing.overload
def simulate_records(
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
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64]]:
    """
    States (B, pieces + 1, n_x) of records with the starts x0 (B, n_x) under the inputs u (pieces, n_u), each held for its dt (pieces,); statuses, and how many pieces were completed. A jump ends a record.
    """

@typing.overload
def simulate_records(
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
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64]]:
    """
    States (B, pieces + 1, n_x) of records with the starts x0 (B, n_x) under the inputs u (pieces, n_u), each held for its dt (pieces,); statuses, and how many pieces were completed. A jump ends a record.
    """

@typing.overload
def simulate_records(
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
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64]]:
    """
    States (B, pieces + 1, n_x) of records with the starts x0 (B, n_x) under the inputs u (pieces, n_u), each held for its dt (pieces,); statuses, and how many pieces were completed. A jump ends a record.
    """
