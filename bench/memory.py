"""Peak memory of a predictive covariance against the number of nodes R, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys

CODE = """
from bench.workload import MODEL, PRIOR, candidates
import fisherpoint as fp
fp.predictive_covariance(MODEL, candidates()[0][:1], PRIOR, fp.TensorGrid({levels}), threads=1)
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


def measure(quick: bool) -> dict[str, float]:
    """Peak resident memory in MB by the number of nodes."""
    names = ("a_tau", "b_tau", "m_q", "E_oil", "p_t", "B_v", "c_L", "V_0A", "V_0B")
    grids: dict[int, object] = {3**7: dict(zip(names, [3] * 7 + [1] * 2, strict=True)), 3**9: 3}
    grids |= {} if quick else {5**9: 5}
    peak = {}
    for nodes, levels in grids.items():
        run = subprocess.run([sys.executable, "-c", CODE.format(levels=levels)], capture_output=True, text=True, check=True)
        peak[str(nodes)] = int(run.stdout) / 1024
    return peak
