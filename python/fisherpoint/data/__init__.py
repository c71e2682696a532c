"""What was measured: outputs of experiment points, on a virtual or a real rig, and their files."""

from .measurements import Measurements
from .rig import VirtualRig

__all__ = ["Measurements", "VirtualRig"]
