"""Measurements: outputs of experiment points and of records, on a virtual or a real rig, and their files."""

from .measurements import Measurements
from .pieces import Pieces, pieces
from .record import Record
from .record_trajectory import RecordTrajectory, simulate_record
from .rig import VirtualRig

__all__ = ["Measurements", "Pieces", "Record", "RecordTrajectory", "VirtualRig", "pieces", "simulate_record"]
