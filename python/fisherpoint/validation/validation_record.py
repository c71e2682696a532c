"""What was validated, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ..basics.field_checks import Extents
from ..basics.result_files import Codec
from ..basics.values import FrozenMapping
from ..information.problem import DesignProblem
from ..models import Model
from ..models.codec import model_from_json, model_to_json
from ..noise.models import NoiseOf
from .design_validation import DesignValidation


@dataclass(frozen=True, eq=False, repr=False)
class ValidatedDesigns:
    """What `validate` found; it shows itself as a table.

    Attributes
    ----------
    problem : DesignProblem
    designs : mapping of name to DesignValidation
    noise : mapping of output name to float or Noise, or NoiseModel
        Of the outputs that were measured.
    runs : int
        Virtual experiments with each design that were made.
    theta : "prior", "mean" or mapping of parameter name to float
    seed : int
    redrawn : int
        Draws from the prior that were left out because they make no sense to the model.
    truth : Model or None
        Model that made the data, if not the problem's.
    noise_known : bool
        Whether the fits knew the noise, or estimated it.
    use_prior : bool
    seconds : float
    requested : int
        Requested number of virtual experiments: more than `runs` where Ctrl-C came first.
    spread : mapping of name to float
        Of local parameters whose values scattered by another standard deviation than the problem has.
    """

    problem: DesignProblem
    designs: Mapping[str, DesignValidation]
    noise: NoiseOf
    runs: int
    theta: str | Mapping[str, float]
    seed: int
    redrawn: int
    truth: Model | None
    noise_known: bool
    use_prior: bool
    seconds: float
    requested: int = 0
    spread: Mapping[str, float] = FrozenMapping({})

    _CODEC: ClassVar[Codec] = {Model: (model_to_json, model_from_json)}
    _EXTENTS: ClassVar[Extents] = {
        "designs": ("+",),
        "designs.parameters": ("problem.estimated",),
        "designs.local": ("problem.local_parameters",),
        "spread": ("any problem.local_parameters",),
    }

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it before all virtual experiments were made."""
        return self.runs < self.requested
