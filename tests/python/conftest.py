"""What several test files share: the reference values, the default cylinder's cases, and random points of a region."""

from __future__ import annotations

import io
import json
import os
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint_command import cli
from oracle import Floats

REGION = {
    "q": (0.03, 0.27),
    "v": (-0.25, 0.25),
    "p_A": (2e6, 19e6),
    "p_B": (2e6, 19e6),
    "x_v": (-0.8, 0.8),
    "u": (-1.0, 1.0),
    "dt": (1e-3, 1e-2),
}


def pytest_report_header() -> str:
    """Which of the long tests are run, so that what fails can be run again."""
    return f"FISHERPOINT_LONG_TESTS = {os.environ.get('FISHERPOINT_LONG_TESTS', '0/1')}"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep one test in n, those whose name's checksum leaves k, with FISHERPOINT_TEST_SHARE = k/n.

    FISHERPOINT_LONG_TESTS = k/n does so to tests that are marked as long.
    """
    k, n = map(int, os.environ.get("FISHERPOINT_TEST_SHARE", "0/1").split("/"))
    long_k, long_n = map(int, os.environ.get("FISHERPOINT_LONG_TESTS", "0/1").split("/"))
    kept, left_out = [], []
    for item in items:
        checksum = crc32(item.nodeid.encode())
        is_short = item.get_closest_marker("long") is None
        (kept if (is_short or checksum % long_n == long_k) and checksum // long_n % n == k else left_out).append(item)
    config.hook.pytest_deselected(items=left_out)
    items[:] = kept


@pytest.fixture(scope="session")
def reference() -> Any:
    """Values of an independent program for the 50/36 mm cylinder."""
    return json.loads((Path(__file__).parent / "data" / "cylinder.json").read_text())


@pytest.fixture(scope="session")
def workload() -> dict[str, Floats]:
    """The performance workload with reference outputs, where the folder of reference values lies beside the project."""
    path = Path(__file__).resolve().parents[3] / "shared" / "reference" / "workload.npz"
    if not path.exists():
        pytest.skip("shared/reference/workload.npz is not beside the project")
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays}


@pytest.fixture
def quiet() -> Iterator[None]:
    """For tests of `CallableModel` that are not about what is said of its cost."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "CallableModel", UserWarning)
        yield


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run a command in this process; gives its exit code and what it printed on the two streams."""

    def call(*arguments: object, stdin: str | None = None) -> tuple[int, str, str]:
        if stdin is not None:
            monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin.encode())))
        capsys.readouterr()
        with pytest.raises(SystemExit) as caught:
            cli.main([str(argument) for argument in arguments])
        told = capsys.readouterr()
        return int(caught.value.code or 0), told.out, told.err

    return call


def experiments(cases: list[dict[str, Any]]) -> fp.Experiments:
    """Experiments from the points of a reference file."""
    return fp.Experiments([case["x0"] for case in cases], [[case["u"]] for case in cases], [case["dt"] for case in cases])


def random_points(rng: np.random.Generator, count: int, bounds: dict[str, tuple[float, float]] = REGION) -> fp.Experiments:
    """Points drawn uniformly in the box of the bounds; some of them meet v = 0 or leave the domain."""
    low, high = np.array(list(bounds.values())).T
    drawn = rng.uniform(low, high, (count, len(bounds)))
    return fp.Experiments(drawn[:, :5], drawn[:, 5:6], drawn[:, 6])


@pytest.fixture(scope="session")
def decay_problem() -> fp.DesignProblem:
    """The example of an exponential decay."""
    from fisherpoint.design.file.configuration import load_config  # which needs the extras

    return load_config(Path(__file__).resolve().parents[2] / "examples" / "exponential_decay.toml").problem()


@pytest.fixture(scope="session")
def decay_designs(decay_problem: fp.DesignProblem) -> tuple[fp.Design, fp.Design]:
    """Two quick designs of the decay."""
    quick: dict[str, Any] = {"n_experiments": 4, "n_candidates": 5, "max_iterations": 3}
    return fp.exchange(decay_problem, **quick, seed=1), fp.exchange(decay_problem, **quick, seed=2)
