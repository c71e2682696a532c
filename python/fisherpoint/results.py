"""What results consist of: classes that nobody makes by hand, for annotations and `isinstance`."""

from .campaign.many import Campaigns
from .data import RecordTrajectory
from .design.compare.compare import ComparedDesign, DesignComparison
from .design.fleet.fleet_settings import FleetSettings
from .design.results.efficiency import Efficiency
from .design.results.found_design import TraceRecord
from .design.results.scenario_values import ScenarioValues
from .design.results.settings import ExchangeSettings, RunSettings
from .design.sweep.sweep_record import SizedDesign
from .information.comparison import RuleComparison
from .information.feasibility import Feasibility
from .information.identifiability import Identifiability
from .information.local_robustness import Nearby
from .validation.design_validation import DesignValidation

__all__ = [
    "Campaigns",
    "ComparedDesign",
    "DesignComparison",
    "DesignValidation",
    "Efficiency",
    "ExchangeSettings",
    "Feasibility",
    "FleetSettings",
    "Identifiability",
    "Nearby",
    "RecordTrajectory",
    "RuleComparison",
    "RunSettings",
    "ScenarioValues",
    "SizedDesign",
    "TraceRecord",
]
