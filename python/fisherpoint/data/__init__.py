"""What was measured: outputs of experiment points and of records, on a virtual or a real rig, and their files."""

from .measurements import Measurements
from .record import Record
from .record_trajectory import RecordTrajectory, simulate_record
from .rig import VirtualRig

__all__ = ["Measurements", "Record", "RecordTrajectory", "VirtualRig", "simulate_record"]
