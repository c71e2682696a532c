"""Memory: what a call needs beyond its results is given back, and where there is too little a MemoryError says so."""

from __future__ import annotations

import subprocess
import sys

import pytest

SETUP = """
import gc, resource
import numpy as np
import fisherpoint as fp

@fp.model(states={"x": "m", "v": "m/s"}, inputs={"u": "N"}, parameters={"k": "N/m", "d": "N s/m"}, outputs={"x": "m"})
def oscillator(x, u, p):
    return [x.v, u.u - p.k * x.x - p.d * fp.math.max(x.v, 0.1)], [x.x]

def points(count):
    random = np.random.default_rng(1)
    return fp.Experiments(random.uniform(-1, 1, (count, 2)), random.uniform(-1, 1, (count, 1)), random.uniform(0.5, 3, count))

def pages(column):  # 0: all, 1: resident
    with open("/proc/self/statm") as file:
        return int(file.read().split()[column]) * resource.getpagesize()
"""


def run(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", SETUP + program, *arguments], capture_output=True, text=True, timeout=120)


@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the resident memory")
def test_a_large_batch_leaves_no_memory_behind() -> None:
    """The paths of 200,000 trajectories take 160 MB where all are kept at once."""
    done = run("""
many, few = points(200_000), points(10)
fp.sensitivities(oscillator, few, [4.0, 0.2])
before = pages(1)
fp.sensitivities(oscillator, many, [4.0, 0.2])
gc.collect()
print((pages(1) - before) / 1e6)
""")
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 60


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space as Linux does")
@pytest.mark.parametrize("kind", ["sensitivities", "predictive_covariance"])
def test_too_little_memory_is_a_memory_error(kind: str) -> None:
    """With room for more and more of what a call needs; it never ends the process."""
    done = run(
        """
import sys
prior = fp.GaussianPrior({"k": 4.0, "d": 0.2}, {"k": 0.1, "d": 0.1})
calls = {
    "sensitivities": lambda: fp.sensitivities(oscillator, points(20_000), [4.0, 0.2], threads=2),
    "predictive_covariance": lambda: fp.predictive_covariance(oscillator, points(20_000), prior, fp.Unscented(), threads=2),
}
call = calls[sys.argv[1]]
call()
ends = []
for room in np.geomspace(1e5, 3e8, 24):
    resource.setrlimit(resource.RLIMIT_AS, (pages(0) + int(room), resource.RLIM_INFINITY))
    try:
        call()
        ends.append("done")
    except MemoryError:
        ends.append("short")
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
print(*ends)
""",
        kind,
    )
    assert done.returncode == 0, done.stderr
    ends = done.stdout.split()
    assert ends[-1] == "done" and set(ends) == {"short", "done"}
