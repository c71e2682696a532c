"""A model from the table [model] of a TOML file."""

from __future__ import annotations

from pathlib import Path

from pydantic import PrivateAttr, model_validator

from ..basics.checks import as_path
from ..basics.toml_data import parse_toml, read_toml
from ..basics.toml_messages import fail, fail_of
from ..basics.toml_tables import Table, validated, wrong_entries, wrong_names
from ..basics.units import convert_unit
from .base import Model
from .hydraulic_cylinder import MODELS
from .toml_tables import ModelTable


class ModelFile(Table):
    """A file with a model, whatever else it has."""

    model: ModelTable

    _source: str = PrivateAttr("configuration")
    _model: Model | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _build_model(self) -> ModelFile:
        if self.model.equations is None:
            kind = MODELS[self.model.name]
            fail_of(
                wrong_entries(
                    "model.constants", {name: one.unit for name, one in self.model.constants.items()}, kind.constant_quantities
                )
            )
            fail_of(wrong_names("model.smooth", self.model.smooth or (), (*kind.jumps, *kind.kinks)))
        try:
            self._model = _built(self.model)
        except (ValueError, TypeError) as error:
            key = "model.constants: " if self.model.equations is None else "model."
            fail(key + " ".join(str(error).split()))
        return self

    def build_model(self) -> Model:
        """The model of the file."""
        return self._model or _built(self.model)

    def warn_of_units(self, stacklevel: int = 2) -> None:
        """Warn of equations whose units do not fit, unless the file says that this is meant."""
        if self.model.equations is not None and self.model.check_units:
            from .symbolic import SymbolicModel  # which needs SymPy

            model = self.build_model()
            if isinstance(model, SymbolicModel):
                model.warn_of_units(stacklevel + 1)


def load_model(path: str | Path) -> Model:
    """Read a model from the table [model] of a TOML file, such as `Model.to_toml` writes; other tables are not looked at.

    Raises
    ------
    ConfigError
        If the file cannot be read or the model has a mistake: one line that names the file, the key and the place.
    """
    path = as_path(path, "path")
    data = read_toml(path)
    file = validated(ModelFile, {"model": data["model"]} if "model" in data else {}, path)
    file.warn_of_units(stacklevel=3)
    return file.build_model()


def model_from_toml(text: str) -> Model:
    """The model that `Model.to_toml` wrote."""
    return validated(ModelFile, parse_toml(text, "model"), "model").build_model()


def _built(table: ModelTable) -> Model:
    if table.equations is not None:
        from .toml_equations import model_of_table  # which needs SymPy

        return model_of_table(table)
    kind = MODELS[table.name]
    units = {quantity.name: quantity.unit for quantity in kind.constant_quantities}
    values = {name: convert_unit(entry.value, entry.unit or units[name], units[name]) for name, entry in table.constants.items()}
    return kind(smooth=table.smooth, **values)
