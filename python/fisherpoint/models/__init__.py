"""Models x' = f(x, u, theta), y = g(x, u, theta): what one is, and those that come with the package."""

from .base import Model
from .hydraulic_cylinder import MODELS, HydraulicCylinder

__all__ = ["MODELS", "HydraulicCylinder", "Model"]
