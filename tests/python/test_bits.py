"""The recorder of bits: equal results have equal digests, and what differs is named."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fisherpoint as fp

BITS = Path(__file__).resolve().parents[1] / "bits"
parts = runpy.run_path(str(BITS / "digest.py"))["parts"]


def record(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, BITS / "record.py", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_every_bit_of_an_array_counts() -> None:
    one = np.array([0.0, 1.0])
    for other in (np.array([-0.0, 1.0]), np.array([0.0, np.nextafter(1.0, 2.0)]), one.reshape(1, 2), one.astype(np.float32)):
        assert dict(parts({"x": one})) != dict(parts({"x": other}))
    assert dict(parts({"x": one})) == dict(parts({"x": one.copy()}))


def test_digests_stand_by_their_places() -> None:
    model = fp.HydraulicCylinder()
    trajectories = fp.simulate(model, fp.Experiments([[0.1, 0.2, 5e6, 8e6, 0.3]], [[0.3]], [1e-3]), model.nominal)
    assert {"[x]", "[y]", "[status]"} <= dict(parts(trajectories)).keys()


def test_what_has_no_bits_is_refused() -> None:
    with pytest.raises(TypeError, match=r"given object: \[x\]\[1\]"):
        dict(parts({"x": [1.0, object()]}))


def test_a_record_names_what_differs(tmp_path: Path) -> None:
    before, after = tmp_path / "before.json", tmp_path / "after.json"
    assert record(before, "--only", "simulate from").returncode == 0
    same = record(after, "--only", "simulate from", "--against", before)
    assert same.returncode == 0 and "1 of 1 the same bits" in same.stdout, same.stderr
    digests = json.loads(before.read_text())
    digests["simulate from equations"]["[y]"] = "0"
    before.write_text(json.dumps(digests))
    changed = record(after, "--only", "simulate from", "--against", before)
    assert changed.returncode == 1 and "simulate from equations: 1 of 4 differ: [y]" in changed.stdout
