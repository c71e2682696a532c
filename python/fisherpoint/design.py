"""A design as the search returns it, and as a directory of files from which it can be repeated."""

from __future__ import annotations

import platform
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .csv_table import CsvTable
from .efficiency import Efficiency
from .evaluation import Evaluation
from .experiments import Experiments, points_csv
from .extras import needed_for
from .files import built_from, parse_json, read_bytes, sealed_json, write_together
from .kernels import isa
from .messages import printable, shown
from .models import MODELS, HydraulicCylinder, Model
from .prior import GaussianPrior
from .problem import DERIVED, DesignProblem
from .quantity import (
    LARGEST_INT,
    Array,
    FrozenMapping,
    as_float,
    as_path,
    as_positive,
    check_flag,
    check_positive_int,
    names_among,
    names_of,
)
from .region import ExperimentRegion
from .rules import RULES, Rule

FORMAT = "fisherpoint design"
FORMAT_VERSION = 2  # 1 had no checksum
PICTURES = ("criterion.png", "points.png", "standard_errors.png", "correlation.png", "trajectories.png")
"""What the command line draws of a design; of points that are evaluated, all but the first."""

STOP_REASONS = ("max_iterations", "patience", "time_limit", "interrupted")
_LEAST = {"n_experiments": 1, "n_candidates": 1, "max_iterations": 0, "seed": 0, "patience": 1, "max_redraws": 0}
MOST = {"n_experiments": 10**6, "n_candidates": 10**6, "max_iterations": 10**9, "patience": 10**9, "max_redraws": 10**6}


@dataclass(frozen=True)
class ExchangeSettings:
    """The arguments of `exchange` that decide its result."""

    n_experiments: int
    n_candidates: int
    max_iterations: int
    seed: int
    patience: int | None
    time_limit: float | None
    max_redraws: int
    references: bool
    screen: bool = False  # as in files that do not say
    local: float = 0.0

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        for name, least in _LEAST.items():
            value = getattr(self, name)
            if value is not None or name != "patience":
                set_field(self, name, check_positive_int(value, name, least, MOST.get(name, LARGEST_INT)))
        if self.time_limit is not None:
            set_field(self, "time_limit", as_positive(self.time_limit, "time_limit", "number of seconds"))
        set_field(self, "references", check_flag(self.references, "references"))
        set_field(self, "screen", check_flag(self.screen, "screen"))
        set_field(self, "local", as_float(self.local, "local"))
        if not 0 <= self.local <= 1:
            raise ValueError(f"local: expected a share between 0 and 1, given {self.local:g}")


@dataclass(frozen=True)
class TraceRecord:
    """One iteration: log det F after it, whether a point was exchanged, candidates drawn so far, seconds so far."""

    iteration: int
    log_det: float
    exchanged: bool
    drawn: int
    seconds: float


@dataclass(frozen=True, eq=False)
class Design:
    """The points that `exchange` found, with everything needed to judge and to repeat them.

    Attributes
    ----------
    points : Experiments
    evaluation : Evaluation
        Under the problem's output covariance; of the previous points, where there are any, and these together.
    under_noise : Evaluation or None
        Under the sensor noise alone; None where it is not known.
    efficiency : Efficiency or None
        Against the references; None where they were not asked for.
    trace : tuple of TraceRecord
        The first is the random start; log_det never falls.
    rejected : mapping of reason to int
        Candidates that are no points; drawn = accepted + their sum.
    drawn, accepted : int
    stop_reason : {"max_iterations", "patience", "time_limit", "interrupted"}
    seconds : float
    settings : ExchangeSettings
    problem : DesignProblem
    n_previous : int
        Points whose information was already collected: the evaluations count them, `points` does not have them.
    previous_left_out : mapping of reason to int
        Previous points that are none at the prior mean, and say nothing.
    """

    problem: DesignProblem
    settings: ExchangeSettings
    points: Experiments
    evaluation: Evaluation
    under_noise: Evaluation | None
    efficiency: Efficiency | None
    trace: tuple[TraceRecord, ...]
    rejected: Mapping[str, int]
    drawn: int
    accepted: int
    stop_reason: str
    seconds: float
    n_previous: int = 0
    previous_left_out: Mapping[str, int] = FrozenMapping({})

    @property
    def distinct_points(self) -> int:
        """Number of different points; a design may repeat one."""
        return len(np.unique(self.points.table, axis=0))

    def save(self, directory: str | Path) -> None:
        """Write design.csv and design.json into `directory`, which is made where needed.

        Each appears whole or not at all, and design.json last: where it stands, what is beside it belongs to it. Of a design that
        was there before, the command line's report and pictures go.
        """
        directory = as_path(directory, "directory")
        contents = {"design.csv": points_csv(self.points, self.problem.model), "design.json": sealed_json(_to_json(self))}
        directory.mkdir(parents=True, exist_ok=True)
        write_together(directory, contents, stale=("report.txt", *PICTURES))

    @classmethod
    def load(cls, directory: str | Path) -> Design:
        """Read a design that `save` wrote, of which design.json counts; warn where design.csv beside it has other points.

        Raises
        ------
        OSError
            Where design.json cannot be read.
        ValueError
            Where it is truncated, was changed, or is not a design of this format.
        """
        path = as_path(directory, "directory") / "design.json"
        data = parse_json(path, read_bytes(path), FORMAT, FORMAT_VERSION, sealed_since=2)
        design = built_from(path, "design", data, _from_json)
        table = path.with_name("design.csv")
        if table.exists() and not _has_points_of(design, table):
            warnings.warn(
                f"{printable(table)}: expected the points of design.json, given others: it was changed since or is of another run; "
                "the points of design.json count",
                stacklevel=2,
            )
        return design


def _has_points_of(design: Design, path: Path) -> bool:
    """Whether a table has a design's points, whatever columns were filled in and to as many digits as spreadsheets keep."""
    axes = design.problem.model.axes
    try:
        table = CsvTable(path)
        table.read_decimal_commas(names_of(axes))
        points = np.column_stack([table.complete(quantity) for quantity in axes])
    except (OSError, ValueError, KeyError):
        return False
    own = design.points.table[:, : len(axes)]
    return points.shape == own.shape and np.allclose(points, own, rtol=1e-12, atol=0.0)


def versions() -> dict[str, str]:
    """What made a file: versions, and the instruction set, on which the last bits may depend."""
    try:
        own = version("fisherpoint")
    except PackageNotFoundError:
        own = "unknown"
    return {"fisherpoint": own, "numpy": np.__version__, "python": platform.python_version(), "isa": isa()}


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _log_det(value: float | None) -> float:
    return -np.inf if value is None else float(value)


def problem_to_json(problem: DesignProblem) -> dict[str, Any]:
    """A problem as JSON has it; functions among the constraints are not kept."""
    region = problem.region
    region_data = region and {
        "bounds": {name: list(pair) for name, pair in region.bounds.items()},
        "constraints": [constraint if isinstance(constraint, str) else None for constraint in region.constraints],
    }
    return {
        "model": model_to_json(problem.model),
        "prior": prior_to_json(problem.prior),
        "region": region_data,
        "noise_std": None if problem.noise_std is None else dict(problem.noise_std),
        "rule": _rule_to_json(problem.rule),
        "output_covariance": problem.output_covariance,
        "parameters": list(problem.estimated),
        "kinks": problem.kinks,
        "rtol": problem.rtol,
        "uncertain": None if problem.uncertain is None else dict(problem.uncertain),
        "initial_state_std": None if problem.initial_state_std is None else dict(problem.initial_state_std),
        "assumed_covariance": problem.assumed_covariance,
        "derived": list(problem.derived),
    }


def prior_to_json(prior: GaussianPrior) -> dict[str, Any]:
    return {
        "mean": dict(prior.mean),
        "std": dict(prior.std),
        "covariance": prior.covariance.tolist() if prior.correlated else None,
        "log": list(prior.log),
    }


def model_to_json(model: Model) -> dict[str, Any]:
    data: dict[str, Any] = {"name": model.name, "constants": dict(model.constants)}
    if not isinstance(model, HydraulicCylinder):
        return data | {"toml": model.to_toml()}
    return data | ({"smooth": dict(model.smooth)} if model.smooth else {})


def model_from_json(data: dict[str, Any]) -> Model:
    if "toml" in data:
        with needed_for("a model with equations"):
            from .config import model_from_toml

        return model_from_toml(data["toml"])
    if data["name"] not in MODELS:
        raise ValueError(f"model: expected one of {', '.join(MODELS)}, given {shown(data['name'])}")
    return MODELS[data["name"]](smooth=data.get("smooth"), **data["constants"])


def prior_from_json(data: dict[str, Any]) -> GaussianPrior:
    covariance = data.get("covariance")
    return GaussianPrior(data["mean"], data["std"] if covariance is None else None, covariance=covariance, log=data.get("log", ()))


def _rule_to_json(rule: Rule) -> dict[str, Any]:
    kind = next(name for name, of_kind in RULES.items() if type(rule) is of_kind)
    given = {field.name: getattr(rule, field.name) for field in fields(rule)}
    return {"kind": kind} | {name: dict(value) if isinstance(value, Mapping) else value for name, value in given.items()}


def _rule_from_json(data: dict[str, Any]) -> Rule:
    arguments = dict(data)
    kind = arguments.pop("kind", "tensor_grid")  # the only one that there was when files did not say which
    if kind not in RULES:
        raise ValueError(f"rule: expected one of {', '.join(RULES)}, given {shown(kind)}")
    rule: Rule = RULES[kind](**arguments)
    return rule


def _constraint_not_saved(columns: Mapping[str, Array]) -> NDArray[np.bool_]:
    raise ValueError("constraint: expected the function that this design was made with, given none: functions are not saved")


def problem_from_json(data: dict[str, Any]) -> DesignProblem:
    """The problem of which this is the JSON, to the last bit."""
    region = data["region"]
    problem = DesignProblem(
        model_from_json(data["model"]),
        prior_from_json(data["prior"]),
        region and ExperimentRegion(region["bounds"], [_constraint_not_saved if c is None else c for c in region["constraints"]]),
        noise_std=data["noise_std"],
        rule=_rule_from_json(data["rule"]),
        output_covariance=data["output_covariance"],
        parameters=data["parameters"],
        kinks=data["kinks"],
        rtol=data["rtol"],
        uncertain=data.get("uncertain"),  # older files have none of these
        initial_state_std=data.get("initial_state_std"),
        assumed_covariance=data.get("assumed_covariance", "tangents"),
    )
    # Not derived anew here: a later version might do so in another way.
    object.__setattr__(problem, "derived", names_among(data.get("derived", ()), DERIVED, "derived"))
    return problem


def _evaluation_to_json(evaluation: Evaluation | None) -> dict[str, Any] | None:
    if evaluation is None:
        return None
    data: dict[str, Any] = {}
    for field in fields(evaluation):
        value = getattr(evaluation, field.name)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        elif isinstance(value, Mapping):
            value = dict(value)
        elif field.name == "null_directions":
            value = [dict(direction) for direction in value]
        data[field.name] = _number(value) if field.name == "log_det" else value
    return data


def _evaluation_from_json(data: dict[str, Any] | None) -> Evaluation | None:
    if data is None:
        return None
    values = {field.name: data[field.name] for field in fields(Evaluation)}
    for name in ("parameters", "outputs", "outputs_left_out"):
        values[name] = tuple(values[name])
    for name in ("fisher", "output_covariance", "covariance", "correlation"):
        values[name] = None if values[name] is None else np.array(values[name], dtype=np.float64)
    for name in ("standard_errors", "rse", "prior_std"):
        values[name] = None if values[name] is None else FrozenMapping(dict(values[name]))
    values["null_directions"] = tuple(FrozenMapping(dict(direction)) for direction in values["null_directions"])
    values["log_det"] = _log_det(values["log_det"])
    return Evaluation(**values)


def _efficiency_from_json(data: dict[str, Any] | None) -> Efficiency | None:
    if data is None:
        return None
    values: dict[str, Any] = {name: float(value) if isinstance(value, str) else value for name, value in data.items()}
    return Efficiency(**values)


def _to_json(design: Design) -> dict[str, Any]:
    efficiency = design.efficiency and {
        name: str(value) if isinstance(value, float) and not np.isfinite(value) else value  # "-inf" of a singular design
        for name, value in asdict(design.efficiency).items()
    }
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "versions": versions(),
        "problem": problem_to_json(design.problem),
        "settings": asdict(design.settings),
        "points": {
            "columns": list(design.points.columns or ()),
            "x0": design.points.x0.tolist(),
            "u": design.points.u.tolist(),
            "dt": design.points.dt.tolist(),
        },
        "evaluation": _evaluation_to_json(design.evaluation),
        "under_noise": _evaluation_to_json(design.under_noise),
        "efficiency": efficiency,
        "trace": [{**asdict(record), "log_det": _number(record.log_det)} for record in design.trace],
        "rejected": dict(design.rejected),
        "drawn": design.drawn,
        "accepted": design.accepted,
        "stop_reason": design.stop_reason,
        "seconds": design.seconds,
        "n_previous": design.n_previous,
        "previous_left_out": dict(design.previous_left_out),
    }


def _from_json(data: dict[str, Any]) -> Design:
    points = data["points"]
    evaluation = _evaluation_from_json(data["evaluation"])
    if evaluation is None:
        raise KeyError("evaluation")
    settings, rejected = ExchangeSettings(**data["settings"]), dict(data["rejected"])
    if len(points["dt"]) != settings.n_experiments:
        raise ValueError(f"points: expected n_experiments = {settings.n_experiments} points, given {len(points['dt'])}")
    for name, count in (("drawn", data["drawn"]), ("accepted", data["accepted"]), *rejected.items()):
        check_positive_int(count, name, 0)
    if data["drawn"] != data["accepted"] + sum(rejected.values()):
        raise ValueError(f"drawn: expected accepted and rejected to add up to it, given {data['drawn']}")
    if data["stop_reason"] not in STOP_REASONS:
        raise ValueError(f"stop_reason: expected one of {', '.join(STOP_REASONS)}; given {shown(data['stop_reason'])}")
    return Design(
        problem=problem_from_json(data["problem"]),
        settings=settings,
        points=Experiments(points["x0"], points["u"], points["dt"], tuple(points["columns"]) or None),
        evaluation=evaluation,
        under_noise=_evaluation_from_json(data["under_noise"]),
        efficiency=_efficiency_from_json(data["efficiency"]),
        trace=tuple(TraceRecord(**{**record, "log_det": _log_det(record["log_det"])}) for record in data["trace"]),
        rejected=FrozenMapping(rejected),
        drawn=data["drawn"],
        accepted=data["accepted"],
        stop_reason=data["stop_reason"],
        seconds=data["seconds"],
        n_previous=check_positive_int(data.get("n_previous", 0), "n_previous", 0),  # older files have neither
        previous_left_out=FrozenMapping(
            {
                reason: check_positive_int(count, "previous_left_out", 0)
                for reason, count in data.get("previous_left_out", {}).items()
            }
        ),
    )
