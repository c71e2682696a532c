"""Short experiments that determine the parameters of a nonlinear state space model as precisely as possible."""

from __future__ import annotations

TYPE_CHECKING = False  # `typing` takes a while to import
if TYPE_CHECKING:  # what tools read; `_PLACES` says the same to Python
    from . import results as results
    from .basics.quantity import Quantity
    from .basics.stop_reason import StopReason
    from .basics.units import convert_unit
    from .campaign.campaign import Campaign
    from .campaign.many import campaigns
    from .data import Measurements, Record, VirtualRig, simulate_record
    from .data.pieces import Pieces, pieces
    from .design.approximate.approximate import approximate_design
    from .design.approximate.approximate_design import ApproximateDesign
    from .design.compare.compare import compare
    from .design.exact.exact import exact_design
    from .design.exact.exact_design import ExactDesign
    from .design.file.configuration import load_problem
    from .design.fleet.design_fleet import design_fleet
    from .design.fleet.fleet_design import FleetDesign
    from .design.goal.criteria import Criterion
    from .design.goal.goal import Goal
    from .design.goal.goal_criterion import criterion
    from .design.goal.over_prior import OverPrior
    from .design.pieces.design_pieces import design_pieces
    from .design.pieces.piece_design import PieceDesign
    from .design.points.exchange import exchange
    from .design.results.cost import Cost
    from .design.results.design import Design
    from .design.results.settings import ExchangeMethod
    from .design.runs.design_runs import design_runs
    from .design.runs.run_design import RunDesign
    from .design.sweep.sweep import Sweep, sweep
    from .engine.levels import instruction_set, instruction_sets
    from .estimation.estimate import estimate
    from .estimation.fit import Fit
    from .information.assumed import assumed_covariance
    from .information.comparison import compare_rules
    from .information.deviations import Deviations
    from .information.evaluate import evaluate
    from .information.evaluation import Evaluation
    from .information.feasibility import feasibility
    from .information.identifiability import identifiability
    from .information.local import Local
    from .information.problem import DesignProblem
    from .models import HydraulicCylinder, Model
    from .models import math as math
    from .models.callable.model import CallableModel
    from .models.decorator import model
    from .models.definitions import let
    from .models.symbolic import SymbolicModel
    from .models.toml_to_model import load_model
    from .noise.models import GaussMarkov, Noise, NoiseModel
    from .points.broken_limits import broken_limits
    from .points.constraints import Constraint
    from .points.experiments import Experiments
    from .points.predictive import PredictiveCovariance, predictive_covariance
    from .points.profiles import PRBS, Given, Held, Ramps, Spline
    from .points.region import ExperimentRegion
    from .points.rest import Rest
    from .points.run_region import RunRegion
    from .points.runs import Runs
    from .points.simulate import sensitivities, simulate
    from .points.sines import Chirp, Multisine
    from .points.status import Status
    from .points.trajectories import Sensitivities, Trajectories
    from .prior.gaussian import GaussianPrior
    from .prior.rules import GaussHermite, LinearizedRule, Rule, Sobol, SparseGaussHermite, TensorGrid, Unscented
    from .show.progress import Progress
    from .validation.result import Validation
    from .validation.validate import validate
__version__ = "0.1.0"

__all__ = [
    "PRBS",
    "ApproximateDesign",
    "CallableModel",
    "Campaign",
    "Chirp",
    "Constraint",
    "Cost",
    "Criterion",
    "Design",
    "DesignProblem",
    "Deviations",
    "Evaluation",
    "ExactDesign",
    "ExchangeMethod",
    "ExperimentRegion",
    "Experiments",
    "Fit",
    "FleetDesign",
    "GaussHermite",
    "GaussMarkov",
    "GaussianPrior",
    "Given",
    "Goal",
    "Held",
    "HydraulicCylinder",
    "LinearizedRule",
    "Local",
    "Measurements",
    "Model",
    "Multisine",
    "Noise",
    "NoiseModel",
    "OverPrior",
    "PieceDesign",
    "Pieces",
    "PredictiveCovariance",
    "Progress",
    "Quantity",
    "Ramps",
    "Record",
    "Rest",
    "Rule",
    "RunDesign",
    "RunRegion",
    "Runs",
    "Sensitivities",
    "Sobol",
    "SparseGaussHermite",
    "Spline",
    "Status",
    "StopReason",
    "Sweep",
    "SymbolicModel",
    "TensorGrid",
    "Trajectories",
    "Unscented",
    "Validation",
    "VirtualRig",
    "approximate_design",
    "assumed_covariance",
    "broken_limits",
    "campaigns",
    "compare",
    "compare_rules",
    "convert_unit",
    "criterion",
    "design_fleet",
    "design_pieces",
    "design_runs",
    "estimate",
    "evaluate",
    "exact_design",
    "exchange",
    "feasibility",
    "identifiability",
    "instruction_set",
    "instruction_sets",
    "let",
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
    ".basics.units": ("convert_unit",),
    ".campaign.campaign": ("Campaign",),
    ".campaign.many": ("campaigns",),
    ".data": ("Measurements", "Record", "VirtualRig", "simulate_record"),
    ".data.pieces": ("Pieces", "pieces"),
    ".design.approximate.approximate": ("approximate_design",),
    ".design.compare.compare": ("compare",),
    ".design.file.configuration": ("load_problem",),
    ".design.results.cost": ("Cost",),
    ".design.exact.exact": ("exact_design",),
    ".design.points.exchange": ("exchange",),
    ".design.approximate.approximate_design": ("ApproximateDesign",),
    ".design.exact.exact_design": ("ExactDesign",),
    ".design.goal.goal": ("Goal",),
    ".design.goal.goal_criterion": ("criterion",),
    ".design.fleet.design_fleet": ("design_fleet",),
    ".design.fleet.fleet_design": ("FleetDesign",),
    ".design.goal.criteria": ("Criterion",),
    ".design.goal.over_prior": ("OverPrior",),
    ".design.pieces.design_pieces": ("design_pieces",),
    ".design.pieces.piece_design": ("PieceDesign",),
    ".design.results.design": ("Design",),
    ".design.runs.design_runs": ("design_runs",),
    ".design.runs.run_design": ("RunDesign",),
    ".design.results.settings": ("ExchangeMethod",),
    ".design.sweep.sweep": ("Sweep", "sweep"),
    ".engine.levels": ("instruction_set", "instruction_sets"),
    ".estimation.estimate": ("estimate",),
    ".estimation.fit": ("Fit",),
    ".information.assumed": ("assumed_covariance",),
    ".information.comparison": ("compare_rules",),
    ".information.deviations": ("Deviations",),
    ".information.evaluate": ("evaluate",),
    ".information.evaluation": ("Evaluation",),
    ".information.feasibility": ("feasibility",),
    ".information.identifiability": ("identifiability",),
    ".information.local": ("Local",),
    ".information.problem": ("DesignProblem",),
    ".models": ("HydraulicCylinder", "Model"),
    ".models.callable.model": ("CallableModel",),
    ".models.decorator": ("model",),
    ".models.definitions": ("let",),
    ".models.symbolic": ("SymbolicModel",),
    ".models.toml_to_model": ("load_model",),
    ".noise.models": ("GaussMarkov", "Noise", "NoiseModel"),
    ".points.broken_limits": ("broken_limits",),
    ".points.constraints": ("Constraint",),
    ".points.experiments": ("Experiments",),
    ".points.predictive": ("PredictiveCovariance", "predictive_covariance"),
    ".points.profiles": ("PRBS", "Given", "Held", "Ramps", "Spline"),
    ".points.region": ("ExperimentRegion",),
    ".points.rest": ("Rest",),
    ".points.run_region": ("RunRegion",),
    ".points.runs": ("Runs",),
    ".points.simulate": ("sensitivities", "simulate"),
    ".points.sines": ("Chirp", "Multisine"),
    ".points.status": ("Status",),
    ".points.trajectories": ("Sensitivities", "Trajectories"),
    ".prior.gaussian": ("GaussianPrior",),
    ".prior.rules": ("GaussHermite", "LinearizedRule", "Rule", "Sobol", "SparseGaussHermite", "TensorGrid", "Unscented"),
    ".show.progress": ("Progress",),
    ".validation.result": ("Validation",),
    ".validation.validate": ("validate",),
}
"""The modules that have these names. Each is imported at the first use of a name, so that unused ones cost no time."""

_MODULES = {"math": ".models.math", "results": ".results"}
"""Modules with names of their own: functions of equations, and what results consist of."""

_RENAMED = {
    "Linearized": "LinearizedRule",
    "approximate": "approximate_design",
    "available_isas": "instruction_sets",
    "best_pieces": "design_pieces",
    "convert": "convert_unit",
    "evaluate_design": "evaluate",
    "evaluate_under_noise": "evaluate(..., output_covariance='noise')",
    "exact": "exact_design",
    "isa": "instruction_set",
}

if not TYPE_CHECKING:  # for which every name would exist

    def __getattr__(name: str) -> object:
        """Import what has the name."""
        from importlib import import_module

        from .basics.interrupts import interrupts_wait

        places = [place for place, names in _PLACES.items() if name in names]
        if name in _MODULES:
            places = [_MODULES[name]]
        if not places:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}{_elsewhere(name)}")
        with interrupts_wait():
            module = import_module(places[0], __name__)
        value = globals()[name] = module if name in _MODULES else getattr(module, name)
        return value


def _elsewhere(name: str) -> str:
    """Where a name is that is not here, for the message."""
    from importlib import import_module

    from .basics.formulas import ARGUMENTS

    if name in _RENAMED:
        return f": it is fisherpoint.{_RENAMED[name]}"
    if name in {*ARGUMENTS, "latch", "delay"}:
        return f": it is fisherpoint.math.{name}"
    if name[:1].isupper() and name in import_module(".results", __name__).__all__:
        return f": it is fisherpoint.results.{name}"
    return ""


def __dir__() -> list[str]:
    return sorted({*__all__, *_MODULES, "__version__"})
