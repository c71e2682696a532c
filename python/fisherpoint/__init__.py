"""Which short experiments to run so that the parameters of a nonlinear state space model come out as precise as possible."""

from typing import Any

from .basics.extras import needed_for
from .basics.quantity import Quantity
from .campaign.campaign import Campaign
from .data import Measurements, Record, RecordTrajectory, VirtualRig, simulate_record
from .design.efficiency import Efficiency
from .design.exchange import exchange
from .design.found import ExchangeSettings, TraceRecord
from .design.result import Design
from .design.search import Progress
from .engine.levels import available_isas, isa
from .estimation.estimate import estimate
from .estimation.fit import Fit
from .information.assumed import assumed_covariance
from .information.comparison import RuleComparison, compare_rules
from .information.evaluation import Evaluation, evaluate_design, evaluate_under_noise
from .information.identifiability import Identifiability, identifiability
from .information.problem import DesignProblem
from .models import HydraulicCylinder, Model
from .points.constraints import Constraint
from .points.experiments import Experiments
from .points.predictive import PredictiveCovariance, predictive_covariance
from .points.region import ExperimentRegion
from .points.trajectories import Sensitivities, Status, Trajectories, sensitivities, simulate
from .prior.gaussian import GaussianPrior
from .prior.rules import GaussHermite, Linearized, Rule, Sobol, SparseGaussHermite, TensorGrid, Unscented
from .validation.of_design import DesignValidation
from .validation.result import Validation
from .validation.validate import validate

__version__ = "0.1.0"

__all__ = [
    "Campaign",
    "Constraint",
    "Design",
    "DesignProblem",
    "DesignValidation",
    "Efficiency",
    "Evaluation",
    "ExchangeSettings",
    "ExperimentRegion",
    "Experiments",
    "Fit",
    "GaussHermite",
    "GaussianPrior",
    "HydraulicCylinder",
    "Identifiability",
    "Linearized",
    "Measurements",
    "Model",
    "PredictiveCovariance",
    "Progress",
    "Quantity",
    "Record",
    "RecordTrajectory",
    "Rule",
    "RuleComparison",
    "Sensitivities",
    "Sobol",
    "SparseGaussHermite",
    "Status",
    "TensorGrid",
    "TraceRecord",
    "Trajectories",
    "Unscented",
    "Validation",
    "VirtualRig",
    "assumed_covariance",
    "available_isas",
    "compare_rules",
    "estimate",
    "evaluate_design",
    "evaluate_under_noise",
    "exchange",
    "identifiability",
    "isa",
    "predictive_covariance",
    "sensitivities",
    "simulate",
    "simulate_record",
    "validate",
]

_LAZY = {
    "CallableModel": ".models.callable.model",
    "SymbolicModel": ".models.symbolic",
    "model": ".models.decorator",
    "load_model": ".models.toml",
}


def __getattr__(name: str) -> Any:
    """What needs SymPy is imported when it is asked for: models as equations, and the functions that these use."""
    from importlib import import_module

    if name in _LAZY:
        with needed_for(name):
            return getattr(import_module(_LAZY[name], __name__), name)
    if not name.startswith("_"):
        with needed_for(name):
            functions = import_module(".models.functions", __name__).FUNCTIONS
        if name in functions:
            return functions[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
