"""
What the core does once, whatever the instruction set: models, prior nodes, Fisher accumulator.
"""

from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing

__all__: list[str] = [
    "CompiledModel",
    "FisherAccumulator",
    "HydraulicCylinder",
    "NodeTable",
    "PriorGrid",
    "PriorNodes",
    "Program",
    "StraightModel",
    "TapeModel",
    "cells",
    "cells_between",
    "log_det",
    "operations",
    "supported_isas",
    "whiten",
]

class HydraulicCylinder:
    domain: typing.ClassVar[list[typing.Any]] = ["p_A - p_t", "p_s - p_A", "p_B - p_t", "p_s - p_B", "V_A", "V_B"]
    inputs: typing.ClassVar[list[typing.Any]] = [("u", "1", "valve control value", 1.0)]
    jumps: typing.ClassVar[list[typing.Any]] = ["v"]
    kinks: typing.ClassVar[list[typing.Any]] = ["x_v"]
    name: typing.ClassVar[str] = "hydraulic_cylinder"
    outputs: typing.ClassVar[list[typing.Any]] = [
        ("q", "m", "piston position", 0.5),
        ("p_A", "Pa", "pressure in chamber A", 10000000.0),
        ("p_B", "Pa", "pressure in chamber B", 10000000.0),
        ("x_v", "1", "valve spool position", 1.0),
    ]
    parameters: typing.ClassVar[list[typing.Any]] = [
        ("a_tau", "N", "Coulomb friction", 1.0),
        ("b_tau", "N s/m", "viscous friction", 1.0),
        ("m_q", "kg", "moved mass", 1.0),
        ("E_oil", "Pa", "bulk modulus of the oil", 1.0),
        ("p_t", "Pa", "tank pressure", 1.0),
        ("B_v", "m3/(s sqrt(Pa))", "valve flow coefficient, c_d sqrt(2/rho)", 1.0),
        ("c_L", "m3/(s sqrt(Pa))", "leakage coefficient", 1.0),
        ("V_0A", "m3", "dead volume of chamber A", 1.0),
        ("V_0B", "m3", "dead volume of chamber B", 1.0),
    ]
    states: typing.ClassVar[list[typing.Any]] = [
        ("q", "m", "piston position", 0.5),
        ("v", "m/s", "piston velocity", 1.0),
        ("p_A", "Pa", "pressure in chamber A", 10000000.0),
        ("p_B", "Pa", "pressure in chamber B", 10000000.0),
        ("x_v", "1", "valve spool position", 1.0),
    ]
    def __init__(
        self,
        *,
        A_A: typing.SupportsFloat | typing.SupportsIndex = 0.0019635,
        A_B: typing.SupportsFloat | typing.SupportsIndex = 0.00094562,
        q_min: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        q_max: typing.SupportsFloat | typing.SupportsIndex = 0.3,
        p_s: typing.SupportsFloat | typing.SupportsIndex = 21000000.0,
        T_1: typing.SupportsFloat | typing.SupportsIndex = 0.0022,
        k_u: typing.SupportsFloat | typing.SupportsIndex = -1.0,
    ) -> None: ...
    def limits(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    def output(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    def rhs(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    def switching(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    @property
    def A_A(self) -> float: ...
    @property
    def A_B(self) -> float: ...
    @property
    def T_1(self) -> float: ...
    @property
    def k_u(self) -> float: ...
    @property
    def p_s(self) -> float: ...
    @property
    def q_max(self) -> float: ...
    @property
    def q_min(self) -> float: ...

class Program:
    def __init__(
        self,
        literals: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex],
        setup: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        stage: typing.Annotated[numpy.typing.ArrayLike, numpy.int32],
        outputs: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex],
        registers: typing.SupportsInt | typing.SupportsIndex,
    ) -> None: ...

class TapeModel:
    def __init__(
        self,
        scales: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex],
        inputs: typing.SupportsInt | typing.SupportsIndex,
        outputs: typing.SupportsInt | typing.SupportsIndex,
        parameters: typing.SupportsInt | typing.SupportsIndex,
        jumps: typing.SupportsInt | typing.SupportsIndex,
        kinks: typing.SupportsInt | typing.SupportsIndex,
        poles: typing.SupportsInt | typing.SupportsIndex,
        limits: typing.SupportsInt | typing.SupportsIndex,
        measured: typing.SupportsInt | typing.SupportsIndex,
        rates: Program,
        output: Program,
        surfaces: Program,
        surface_rates: Program,
        state_jacobian: Program,
        rate_jacobian: Program,
        output_jacobian: Program,
        jump_jacobian: Program,
        state_entries: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
        rate_entries: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
        output_entries: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
        jump_entries: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
        varying_states: collections.abc.Sequence[bool],
        varying_outputs: collections.abc.Sequence[bool],
        varying_surfaces: collections.abc.Sequence[bool],
        crossable: collections.abc.Sequence[bool],
        rough: collections.abc.Sequence[bool],
        steep: collections.abc.Sequence[bool],
        closed: collections.abc.Sequence[bool],
        constant_slopes: collections.abc.Sequence[bool],
        reset_count: typing.SupportsInt | typing.SupportsIndex,
        resets: Program,
        reset_jacobian: Program,
        reset_targets: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
        reset_entries: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
        reset_levels: collections.abc.Sequence[bool],
        update_count: typing.SupportsInt | typing.SupportsIndex,
        updates: Program,
        update_jacobian: Program,
        update_targets: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
        update_entries: collections.abc.Sequence[
            tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]
        ],
    ) -> None:
        """
        Scales of the states, how many there are of what (the poles and what is measured among the limits), and the programs with their entries.
        """
    def limits(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    def output(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    def output_jacobian(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.ndarray[typing.Any, numpy.dtype[typing.Any]]:
        """
        Derivatives of g by the parameters where the state is held: (K, n_y, p).
        """
    def rhs(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    def switching(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]: ...
    def updated(
        self,
        x: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        u: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        which: typing.SupportsInt | typing.SupportsIndex,
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        States behind the updates that `which` has as bits.
        """

class CompiledModel(TapeModel):
    def __init__(self, tape: TapeModel, library: str) -> None: ...

class StraightModel(TapeModel):
    def __init__(self, tape: TapeModel, library: str) -> None: ...

class PriorNodes:
    """
    Weighted nodes that stand for the prior.
    """
    def __len__(self) -> int: ...
    def nodes(self) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]: ...
    def second_moments(
        self,
        mean: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        std: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        Second moments about the mean in units of std, (p, p).
        """

class PriorGrid(PriorNodes):
    """
    Tensor product of axes; the last runs fastest.
    """
    @typing.overload
    def __init__(
        self,
        axes: collections.abc.Sequence[
            tuple[
                typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
                typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
            ]
        ],
    ) -> None: ...
    @typing.overload
    def __init__(
        self,
        axes: collections.abc.Sequence[
            tuple[
                typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
                typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
            ]
        ],
        center: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        matrix: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        exponential: collections.abc.Sequence[bool],
    ) -> None: ...

class NodeTable(PriorNodes):
    """
    Stored nodes, with parameter sets near the edge of what they cover.
    """
    def __init__(
        self,
        theta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        weights: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        pilots: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> None: ...

class FisherAccumulator:
    """
    Fisher matrix (7) of a set of points, for any output covariance.
    """
    def __init__(
        self, outputs: typing.SupportsInt | typing.SupportsIndex, parameters: typing.SupportsInt | typing.SupportsIndex
    ) -> None: ...
    def __len__(self) -> int: ...
    def add(
        self,
        dy_dtheta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        predictive_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> None:
        """
        Add points: (K, n_y, p) and (K, n_y, n_y).
        """
    def fisher(
        self, output_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        F (p, p) by (7).
        """
    def log_det_with(
        self,
        dy_dtheta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        predictive_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        given: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        pooled: bool,
        ridge: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        nuisance: typing.SupportsInt | typing.SupportsIndex = 0,
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        log det F with each of the points added alone; the last `nuisance` parameters, with unit information, marginalised.
        """
    def log_det_without(
        self,
        dy_dtheta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        predictive_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        given: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        pooled: bool,
        ridge: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        nuisance: typing.SupportsInt | typing.SupportsIndex = 0,
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        The same with each of the points removed alone.
        """
    def output_covariance(
        self, given: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], pooled: bool
    ) -> numpy.typing.NDArray[numpy.float64]:
        """
        D = given, plus the mean predictive covariance (17) where pooled.
        """
    def remove(
        self,
        dy_dtheta: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
        predictive_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    ) -> None:
        """
        Remove points that were added.
        """

def cells(
    mean: typing.SupportsFloat | typing.SupportsIndex,
    std: typing.SupportsFloat | typing.SupportsIndex,
    levels: typing.SupportsInt | typing.SupportsIndex,
    span: typing.SupportsFloat | typing.SupportsIndex,
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Values and cell probabilities (13) of one parameter.
    """

def cells_between(
    edges: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Middles and probabilities of the cells between neighbouring edges, in standard deviations.
    """

def log_det(matrix: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> float:
    """
    log det by Cholesky; -inf where the matrix is not positive definite.
    """

def operations() -> list[str]:
    """
    Names of what a program can do; their places are the codes.
    """

def supported_isas() -> list[str]:
    """
    Instruction-set levels that this machine has, the best last.
    """

def whiten(
    columns: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    times: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    std: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    measured: typing.Annotated[numpy.typing.ArrayLike, numpy.bool],
    correlation: typing.Annotated[numpy.typing.ArrayLike, numpy.float64],
    parts: collections.abc.Sequence[
        tuple[
            typing.SupportsInt | typing.SupportsIndex,
            typing.SupportsFloat | typing.SupportsIndex,
            typing.SupportsFloat | typing.SupportsIndex,
        ]
    ],
    threads: typing.SupportsInt | typing.SupportsIndex = 1,
) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    R^-1/2 of columns (K, N, n_y, C), zero where not measured, and log det R (K,): white noise of std (K, N, n_y) and
    correlation (n_y, n_y), and Gauss-Markov parts (output, std, correlation time).
    """
