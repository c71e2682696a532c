"""Files that were changed: their checksum tells, and where a table and a design do not belong together."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp


@pytest.mark.parametrize("kind", ["design", "fit", "campaign"])
def test_bit_flips_are_refused(
    kind: str, decay_problem: fp.DesignProblem, decay_designs: tuple[fp.Design, fp.Design], tmp_path: Path
) -> None:
    load: Callable[[Path], Any]
    if kind == "design":
        decay_designs[0].save(tmp_path)
        load = fp.Design.load
    elif kind == "fit":
        data = fp.VirtualRig(decay_problem.model, dict(decay_problem.prior.mean), {"c": 0.2}).measure(decay_designs[0].points)
        fp.estimate(decay_problem.model, data, decay_problem.prior, noise=decay_problem.noise).save(tmp_path)
        load = fp.Fit.load
    else:
        fp.Campaign(decay_problem, 2, directory=tmp_path)
        load = fp.Campaign.load
    path = tmp_path / f"{kind}.json"
    content, rng, refused = path.read_bytes(), np.random.default_rng(14), 0
    load(tmp_path)
    for _ in range(300):
        flipped = bytearray(content)
        flipped[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        path.write_bytes(flipped)
        try:
            load(tmp_path)
        except ValueError as error:
            refused += 1
            assert f"{kind}.json: expected" in str(error) and str(error).isprintable() and len(str(error)) < 500
        else:
            assert json.loads(flipped) == json.loads(content)
    assert refused > 290


def test_what_is_changed_is_told(decay_designs: tuple[fp.Design, fp.Design], tmp_path: Path) -> None:
    decay_designs[0].save(tmp_path)
    path = tmp_path / "design.json"
    data = json.loads(path.read_text())
    path.write_text(json.dumps(data))  # indents are nobody's business
    assert fp.Design.load(tmp_path).seconds == decay_designs[0].seconds
    for changed in (
        data | {"versions": {}},
        {name: value for name, value in data.items() if name != "sha256"},
        data | {"sha256": data["sha256"].upper()},
        data | {"sha256": None},
    ):
        path.write_text(json.dumps(changed))
        with pytest.raises(
            ValueError, match=r"design\.json: expected the file as it was written, given one (that was changed|without its SHA-256)"
        ):
            fp.Design.load(tmp_path)


@pytest.mark.parametrize("version", [0, 2, True, 1.0, "1", None])
def test_another_version_is_one_line(version: object, decay_designs: tuple[fp.Design, fp.Design], tmp_path: Path) -> None:
    decay_designs[0].save(tmp_path)
    path = tmp_path / "design.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format_version": version}))
    with pytest.raises(ValueError, match=r"design\.json: expected format version 1, given"):
        fp.Design.load(tmp_path)


def test_a_table_of_another_run_is_told(decay_designs: tuple[fp.Design, fp.Design], tmp_path: Path) -> None:
    decay_designs[0].save(tmp_path)
    path, model = tmp_path / "design.csv", decay_designs[0].problem.model
    own = path.read_text()
    header, *rows = own.splitlines()
    for fine in (
        "\n".join([f"{header},y_c", *(f"{row},10.5" for row in rows)]),
        own.replace(",", ";").replace(".", ","),
        "\n".join(f"{line},note" for line in own.splitlines()),
        None,
    ):
        path.unlink(missing_ok=True)
        if fine is not None:
            path.write_text(fine)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            fp.Design.load(tmp_path)
    decay_designs[1].points.to_csv(path, model)
    for other in (path.read_text(), "", "a,b\n1,2\n", own[: len(own) // 2], "\n".join(own.splitlines()[:-1])):
        path.write_text(other)
        with pytest.warns(UserWarning, match=r"design\.csv: expected the points of design\.json, given others"):
            loaded = fp.Design.load(tmp_path)
        assert loaded.points == decay_designs[0].points
