"""Short experiments that determine the parameters of a nonlinear state space model as precisely as possible."""

from __future__ import annotations

TYPE_CHECKING = False  # `typing` takes a while to import
if TYPE_CHECKING:  # what tools read; `_PLACES` says the same to Python
    from .basics.quantity import Quantity
    from .basics.stop_reason import StopReason
    from .basics.units import convert
    from .campaign.campaign import Campaign
    from .data import Measurements, Record, RecordTrajectory, VirtualRig, simulate_record
    from .data.pieces import Pieces, pieces
    from .design.approximate import approximate
    from .design.compare import ComparedDesign, DesignComparison, compare
    from .design.configuration import load_problem
    from .design.cost import Cost
    from .design.efficiency import Efficiency
    from .design.exact import exact
    from .design.exchange import exchange
    from .design.found import TraceRecord
    from .design.optimality.approximate_design import ApproximateDesign
    from .design.optimality.criteria import Criterion
    from .design.optimality.exact_design import ExactDesign
    from .design.optimality.goal import Goal
    from .design.optimality.goal_criterion import criterion
    from .design.over_prior import OverPrior
    from .design.pieces.best_pieces import best_pieces
    from .design.pieces.piece_design import PieceDesign
    from .design.result import Design
    from .design.runs.design_runs import design_runs
    from .design.runs.run_design import RunDesign
    from .design.scenario_values import ScenarioValues
    from .design.settings import ExchangeMethod, ExchangeSettings, RunSettings
    from .design.sweep import Sweep, sweep
    from .design.swept import SizedDesign
    from .engine.levels import available_isas, isa
    from .estimation.estimate import estimate
    from .estimation.fit import Fit
    from .information.assumed import assumed_covariance
    from .information.comparison import RuleComparison, compare_rules
    from .information.deviations import Deviations
    from .information.evaluate import evaluate_design, evaluate_under_noise
    from .information.evaluation import Evaluation
    from .information.feasibility import Feasibility, feasibility
    from .information.identifiability import Identifiability, identifiability
    from .information.nearby import Nearby
    from .information.problem import DesignProblem
    from .models import HydraulicCylinder, Model
    from .models import math as math
    from .models.callable.model import CallableModel
    from .models.decorator import model
    from .models.math import *  # noqa: F403  as __getattr__ has them
    from .models.symbolic import SymbolicModel
    from .models.toml import load_model
    from .points.broken_limits import broken_limits
    from .points.constraints import Constraint
    from .points.experiments import Experiments
    from .points.predictive import PredictiveCovariance, predictive_covariance
    from .points.region import ExperimentRegion
    from .points.rest import Rest
    from .points.run_region import RunRegion
    from .points.runs import Runs
    from .points.simulate import sensitivities, simulate
    from .points.status import Status
    from .points.trajectories import Sensitivities, Trajectories
    from .prior.gaussian import GaussianPrior
    from .prior.rules import GaussHermite, Linearized, Rule, Sobol, SparseGaussHermite, TensorGrid, Unscented
    from .show.progress import Progress
    from .validation.design_validation import DesignValidation
    from .validation.result import Validation
    from .validation.validate import validate

__version__ = "0.1.0"

__all__ = [
    "ApproximateDesign",
    "CallableModel",
    "Campaign",
    "ComparedDesign",
    "Constraint",
    "Cost",
    "Criterion",
    "Design",
    "DesignComparison",
    "DesignProblem",
    "DesignValidation",
    "Deviations",
    "Efficiency",
    "Evaluation",
    "ExactDesign",
    "ExchangeMethod",
    "ExchangeSettings",
    "ExperimentRegion",
    "Experiments",
    "Feasibility",
    "Fit",
    "GaussHermite",
    "GaussianPrior",
    "Goal",
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
    "RunRegion",
    "RunSettings",
    "Runs",
    "ScenarioValues",
    "Sensitivities",
    "SizedDesign",
    "Sobol",
    "SparseGaussHermite",
    "Status",
    "StopReason",
    "Sweep",
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
    "convert",
    "criterion",
    "design_runs",
    "estimate",
    "evaluate_design",
    "evaluate_under_noise",
    "exact",
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
    "sweep",
    "validate",
]

_PLACES = {
    ".basics.quantity": ("Quantity",),
    ".basics.stop_reason": ("StopReason",),
    ".basics.units": ("convert",),
    ".campaign.campaign": ("Campaign",),
    ".data": ("Measurements", "Record", "RecordTrajectory", "VirtualRig", "simulate_record"),
    ".data.pieces": ("Pieces", "pieces"),
    ".design.approximate": ("approximate",),
    ".design.compare": ("ComparedDesign", "DesignComparison", "compare"),
    ".design.configuration": ("load_problem",),
    ".design.cost": ("Cost",),
    ".design.efficiency": ("Efficiency",),
    ".design.exact": ("exact",),
    ".design.exchange": ("exchange",),
    ".design.found": ("TraceRecord",),
    ".design.optimality.approximate_design": ("ApproximateDesign",),
    ".design.optimality.exact_design": ("ExactDesign",),
    ".design.optimality.goal": ("Goal",),
    ".design.optimality.goal_criterion": ("criterion",),
    ".design.optimality.criteria": ("Criterion",),
    ".design.over_prior": ("OverPrior",),
    ".design.pieces.best_pieces": ("best_pieces",),
    ".design.pieces.piece_design": ("PieceDesign",),
    ".design.result": ("Design",),
    ".design.runs.design_runs": ("design_runs",),
    ".design.runs.run_design": ("RunDesign",),
    ".design.scenario_values": ("ScenarioValues",),
    ".design.settings": ("ExchangeMethod", "ExchangeSettings", "RunSettings"),
    ".design.sweep": ("Sweep", "sweep"),
    ".design.swept": ("SizedDesign",),
    ".engine.levels": ("available_isas", "isa"),
    ".estimation.estimate": ("estimate",),
    ".estimation.fit": ("Fit",),
    ".information.assumed": ("assumed_covariance",),
    ".information.comparison": ("RuleComparison", "compare_rules"),
    ".information.deviations": ("Deviations",),
    ".information.evaluate": ("evaluate_design", "evaluate_under_noise"),
    ".information.evaluation": ("Evaluation",),
    ".information.feasibility": ("Feasibility", "feasibility"),
    ".information.identifiability": ("Identifiability", "identifiability"),
    ".information.nearby": ("Nearby",),
    ".information.problem": ("DesignProblem",),
    ".models": ("HydraulicCylinder", "Model"),
    ".models.callable.model": ("CallableModel",),
    ".models.decorator": ("model",),
    ".models.symbolic": ("SymbolicModel",),
    ".models.toml": ("load_model",),
    ".points.broken_limits": ("broken_limits",),
    ".points.constraints": ("Constraint",),
    ".points.experiments": ("Experiments",),
    ".points.predictive": ("PredictiveCovariance", "predictive_covariance"),
    ".points.region": ("ExperimentRegion",),
    ".points.rest": ("Rest",),
    ".points.run_region": ("RunRegion",),
    ".points.runs": ("Runs",),
    ".points.simulate": ("sensitivities", "simulate"),
    ".points.status": ("Status",),
    ".points.trajectories": ("Sensitivities", "Trajectories"),
    ".prior.gaussian": ("GaussianPrior",),
    ".prior.rules": ("GaussHermite", "Linearized", "Rule", "Sobol", "SparseGaussHermite", "TensorGrid", "Unscented"),
    ".show.progress": ("Progress",),
    ".validation.design_validation": ("DesignValidation",),
    ".validation.result": ("Validation",),
    ".validation.validate": ("validate",),
}
"""The modules that have these names. Each is imported at the first use of a name, so that unused ones cost no time."""

_FUNCTIONS = (
    "abs", "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "heaviside", "latch", "log", "max", "min", "sign", "sin", "sinh",
    "sqrt", "tan", "tanh", "where",
)  # fmt: skip
"""The names of `fisherpoint.math`. They and `math` are not in `__all__`: Python has a `max` and a `math` of its own."""

if not TYPE_CHECKING:  # for which every name would exist

    def __getattr__(name: str) -> object:
        """Import what has the name."""
        from importlib import import_module

        from .basics.extras import needed_for

        places = [place for place, names in _PLACES.items() if name in names]
        if name == "math" or name in _FUNCTIONS:
            places = [".models.math"]
        if not places:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        with needed_for(name):
            module = import_module(places[0], __name__)
        value = globals()[name] = module if name == "math" else getattr(module, name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_FUNCTIONS, "math"})
