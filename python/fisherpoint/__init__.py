"""Which short experiments to run so that the parameters of a nonlinear state space model come out as precise as possible."""

from typing import Any

from .assumed import assumed_covariance
from .campaign import Campaign
from .comparison import RuleComparison, compare_rules
from .constraints import Constraint
from .data import Measurements, Record, RecordTrajectory, VirtualRig, simulate_record
from .design import Design, ExchangeSettings, TraceRecord
from .efficiency import Efficiency
from .estimation.estimate import estimate
from .estimation.fit import Fit
from .evaluation import Evaluation, evaluate_design, evaluate_under_noise
from .exchange import exchange
from .exchange_search import Progress
from .experiments import Experiments
from .extras import needed_for
from .identifiability import Identifiability, identifiability
from .kernels import available_isas, isa
from .models import HydraulicCylinder, Model
from .predictive import PredictiveCovariance, predictive_covariance
from .prior import GaussianPrior
from .problem import DesignProblem
from .quantity import Quantity
from .region import ExperimentRegion
from .rules import GaussHermite, Linearized, Rule, Sobol, SparseGaussHermite, TensorGrid, Unscented
from .trajectories import (
    Sensitivities,
    Status,
    Trajectories,
    sensitivities,
    simulate,
)
from .validation.result import DesignValidation, Validation
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
    "CallableModel": ".models.callable",
    "SymbolicModel": ".models.symbolic",
    "model": ".models.decorator",
    "load_model": ".config",
}


def __getattr__(name: str) -> Any:
    """What needs SymPy is imported when it is asked for: models as equations, and the functions that these use."""
    from importlib import import_module

    if name in _LAZY:
        with needed_for(name):
            return getattr(import_module(_LAZY[name], __name__), name)
    if not name.startswith("_"):
        with needed_for(name):
            functions = import_module(".functions", __name__).FUNCTIONS
        if name in functions:
            return functions[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
