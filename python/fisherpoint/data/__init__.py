"""What was measured: outputs of experiment points, on a virtual or a real rig, and their files."""

from .measurements import Measurements

__all__ = ["Measurements"]
