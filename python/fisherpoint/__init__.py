"""Short experiments that determine the parameters of a nonlinear state space model as precisely as possible."""

from typing import TYPE_CHECKING, Any

from .basics.extras import needed_for
from .basics.quantity import Quantity
from .campaign.campaign import Campaign
from .data import Measurements, Pieces, Record, RecordTrajectory, VirtualRig, pieces, simulate_record
from .design.compare import ComparedDesign, DesignComparison, compare
from .design.efficiency import Efficiency
from .design.exchange import exchange
from .design.found import TraceRecord
from .design.optimality.approximate import approximate
from .design.optimality.approximate_design import ApproximateDesign
from .design.optimality.asked import criterion
from .design.optimality.criteria import Criterion
from .design.over_prior import OverPrior
from .design.pieces.best_pieces import best_pieces
from .design.pieces.piece_design import PieceDesign
from .design.points.point_search import Progress
from .design.result import Design
from .design.runs.design_runs import design_runs
from .design.runs.run_design import RunDesign
from .design.runs.run_search import RunProgress
from .design.scenario_values import ScenarioValues
from .design.settings import ExchangeSettings, RunSettings
from .engine.levels import available_isas, isa
from .estimation.estimate import estimate
from .estimation.fit import Fit
from .information.assumed import assumed_covariance
from .information.comparison import RuleComparison, compare_rules
from .information.evaluation import Evaluation, evaluate_design, evaluate_under_noise
from .information.feasibility import Feasibility, feasibility
from .information.identifiability import Identifiability, identifiability
from .information.nearby import Nearby
from .information.problem import DesignProblem
from .models import HydraulicCylinder, Model
from .points.broken_limits import broken_limits
from .points.constraints import Constraint
from .points.experiments import Experiments
from .points.predictive import PredictiveCovariance, predictive_covariance
from .points.region import ExperimentRegion
from .points.rest import Rest
from .points.run_region import RunRegion
from .points.run_trajectories import RunSensitivities, RunTrajectories
from .points.runs import Runs
from .points.status import Status
from .points.trajectories import Sensitivities, Trajectories, sensitivities, simulate
from .prior.gaussian import GaussianPrior
from .prior.rules import GaussHermite, Linearized, Rule, Sobol, SparseGaussHermite, TensorGrid, Unscented
from .validation.design_validation import DesignValidation
from .validation.result import Validation
from .validation.validate import validate

if TYPE_CHECKING:
    from .design.configuration import load_problem
    from .models import math as math
    from .models.callable.model import CallableModel
    from .models.decorator import model
    from .models.math import *  # noqa: F403  as __getattr__ has them
    from .models.symbolic import SymbolicModel
    from .models.toml import load_model

__version__ = "0.1.0"

__all__ = [
    "ApproximateDesign",
    "CallableModel",
    "Campaign",
    "ComparedDesign",
    "Constraint",
    "Criterion",
    "Design",
    "DesignComparison",
    "DesignProblem",
    "DesignValidation",
    "Efficiency",
    "Evaluation",
    "ExchangeSettings",
    "ExperimentRegion",
    "Experiments",
    "Feasibility",
    "Fit",
    "GaussHermite",
    "GaussianPrior",
    "HydraulicCylinder",
    "Identifiability",
    "Linearized",
    "Measurements",
    "Model",
    "Nearby",
    "OverPrior",
    "PieceDesign",
    "Pieces",
    "PredictiveCovariance",
    "Progress",
    "Quantity",
    "Record",
    "RecordTrajectory",
    "Rest",
    "Rule",
    "RuleComparison",
    "RunDesign",
    "RunProgress",
    "RunRegion",
    "RunSensitivities",
    "RunSettings",
    "RunTrajectories",
    "Runs",
    "ScenarioValues",
    "Sensitivities",
    "Sobol",
    "SparseGaussHermite",
    "Status",
    "SymbolicModel",
    "TensorGrid",
    "TraceRecord",
    "Trajectories",
    "Unscented",
    "Validation",
    "VirtualRig",
    "approximate",
    "assumed_covariance",
    "available_isas",
    "best_pieces",
    "broken_limits",
    "compare",
    "compare_rules",
    "criterion",
    "design_runs",
    "estimate",
    "evaluate_design",
    "evaluate_under_noise",
    "exchange",
    "feasibility",
    "identifiability",
    "isa",
    "load_model",
    "load_problem",
    "model",
    "pieces",
    "predictive_covariance",
    "sensitivities",
    "simulate",
    "simulate_record",
    "validate",
]

_LAZY = {
    "CallableModel": ".models.callable.model",
    "SymbolicModel": ".models.symbolic",
    "load_model": ".models.toml",
    "load_problem": ".design.configuration",
    "model": ".models.decorator",
}
"""What needs SymPy or pydantic, which are slow to import, and the modules that have it."""

_FUNCTIONS = (
    "abs", "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "heaviside", "log", "max", "min", "sign", "sin", "sinh", "sqrt",
    "tan", "tanh", "where",
)  # fmt: skip
"""The names of `fisherpoint.math`. They and `math` are not in `__all__`: Python has a `max` and a `math` of its own."""


if not TYPE_CHECKING:  # for which every name would exist

    def __getattr__(name: str) -> Any:
        """Import what is lazy when it is asked for."""
        from importlib import import_module

        if name == "math" or name in _LAZY or name in _FUNCTIONS:
            with needed_for(name):
                module = import_module(_LAZY.get(name, ".models.math"), __name__)
            return module if name == "math" else getattr(module, name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_FUNCTIONS, "math"})
