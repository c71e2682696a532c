"""A virtual rig: the truth with noise of the stated size, the same again for the same seed, and failures that are counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, NOISE, OUTPUTS, point, same_bits, valid_points

POINTS = valid_points(6)


def rig(**changes: Any) -> fp.VirtualRig:
    return fp.VirtualRig(**({"model": MODEL, "theta": MODEL.nominal, "noise": NOISE} | changes))


def test_the_same_seed_and_calls_give_the_same_data(monkeypatch: pytest.MonkeyPatch) -> None:
    def measured() -> list[fp.Measurements]:
        one = rig(seed=7, initial_state_std={"q": 1e-5})
        return [one.measure(POINTS), one.measure(POINTS, repeats=3)]

    first, again = measured(), measured()
    monkeypatch.setattr("fisherpoint.points.settings.resolve_threads", lambda _: 1)
    for data, other, alone in zip(first, again, measured(), strict=True):
        assert same_bits(data.y, other.y) and same_bits(data.y, alone.y)
    assert not np.any(first[0].y == first[1].y[:6])  # the noise goes on, it does not start again
    assert not np.any(rig(seed=8).measure(POINTS).y == rig(seed=7).measure(POINTS).y)


def test_noise_has_the_stated_size_and_no_memory() -> None:
    truth = fp.simulate(MODEL, POINTS, MODEL.nominal, rtol=1e-10).y
    data = rig(seed=1).measure(POINTS, repeats=2000)
    assert len(data) == 12000 and data.points == fp.Experiments.join([POINTS] * 2000)
    z = (data.y - np.tile(truth, (2000, 1))) / [NOISE[name] for name in OUTPUTS]
    # The limits are five standard errors of each statistic.
    n = z.size
    assert abs(z.mean()) < 5 / np.sqrt(n)
    assert abs(z.std() - 1) < 5 / np.sqrt(2 * n)
    assert stats.kstest(z.ravel(), "norm").pvalue > 1e-6
    between_outputs = np.corrcoef(z.T)[~np.eye(4, dtype=bool)]
    assert np.abs(between_outputs).max() < 5 / np.sqrt(len(z))
    assert np.abs([np.corrcoef(z[1:, j], z[:-1, j])[0, 1] for j in range(4)]).max() < 5 / np.sqrt(len(z))


def test_starts_deviate_and_are_recorded_as_planned() -> None:
    std = {"q": 1e-4, "p_B": 1e5}
    data = rig(noise=dict.fromkeys(NOISE, 0.0), initial_state_std=std, seed=2).measure(POINTS[0], repeats=500)
    assert same_bits(data.points.x0, np.tile(POINTS[0].x0, (500, 1)))
    # To first order y moves with the start: its covariance is J P J^T, J by differences over a fifth of the deviation.
    steps = 0.2 * np.array([std.get(state.name, 0.0) for state in MODEL.states])
    moved = [
        fp.Experiments(POINTS[0].x0 + sign * np.diag(steps)[[0, 3]], [POINTS[0].u[0]] * 2, [POINTS[0].dt[0]] * 2)
        for sign in (1, -1)
    ]
    ahead, behind = (fp.simulate(MODEL, one, MODEL.nominal, rtol=1e-10).y for one in moved)
    jacobian = (ahead - behind) / 2 / steps[[0, 3], None]
    expected = np.sqrt((jacobian**2 * np.square([1e-4, 1e5])[:, None]).sum(axis=0))
    assert expected[:3].all()
    np.testing.assert_allclose(data.y.std(axis=0)[:3], expected[:3], rtol=5 / np.sqrt(2 * 500))
    assert np.ptp(data.y[:, 3]) < 1e-12  # the spool does not know of them


def test_without_noise_it_shows_the_truth() -> None:
    data = rig(noise=dict.fromkeys(NOISE, 0.0)).measure(POINTS)
    assert same_bits(data.y, fp.simulate(MODEL, POINTS, MODEL.nominal, rtol=1e-10).y)


def test_outputs_left_out_are_not_measured_and_change_nothing_else() -> None:
    some = rig(noise={"p_B": 2e4, "q": 5e-6}, seed=3).measure(POINTS)
    every = rig(seed=3, initial_state_std={"v": 0.0}).measure(POINTS)
    assert np.isnan(some.y[:, [1, 3]]).all()
    assert same_bits(np.ascontiguousarray(some.y[:, [0, 2]]), np.ascontiguousarray(every.y[:, [0, 2]]))


def test_what_fails_is_counted_with_its_reason_and_not_measured() -> None:
    drawn = random_points(np.random.default_rng(5), 40)
    status = fp.simulate(MODEL, drawn, MODEL.nominal, rtol=1e-10, jumps="cross").status
    counts = {"left_domain": int((status == fp.Status.left_domain).sum())}
    assert 0 < counts["left_domain"] == (status != 0).sum() < 40
    one = rig()
    failed = counts["left_domain"]
    with pytest.warns(RuntimeWarning, match=rf"{failed} of 40 points are not measured to their ends: {failed} left_domain$"):
        data = one.measure(drawn)
    assert np.array_equal(np.isnan(data.y).any(axis=1), status != 0) and np.array_equal(np.isnan(data.y).all(axis=1), status != 0)
    assert one.failures == counts
    with pytest.warns(RuntimeWarning):
        one.measure(drawn, repeats=2)
    assert one.failures == {name: 3 * count for name, count in counts.items()}


def test_nothing_measured_at_all_is_an_error() -> None:
    with pytest.raises(ValueError, match="expected at least one whose trajectory reaches a sample, given none: 1 left_domain"):
        rig().measure(point(p_A=1e5))
    with pytest.raises(ValueError, match="given none: no points"):
        rig().measure(POINTS[:0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"noise": {"p_C": 1.0}}, "noise: expected names of q, p_A, p_B, x_v; given unknown 'p_C'"),
        ({"noise": {}}, "noise: expected at least one of"),
        ({"noise": {"q": -1.0}}, r"noise\['q'\]: expected a standard deviation of at least 0, given -1"),
        ({"noise": {"q": np.inf}}, r"noise\['q'\]: expected finite numbers"),
        ({"initial_state_std": {"u": 1.0}}, "initial_state_std: expected names of q, v, p_A, p_B, x_v; given unknown 'u'"),
        ({"theta": {"m_q": 1.0}}, "theta: expected a value for 'a_tau'"),
        ({"theta": np.ones((2, 9))}, r"theta: expected shape \(9,\), given \(2, 9\)"),
        ({"theta": dict(MODEL.nominal) | {"m_q": -1.0}}, "m_q: expected a positive number"),
        ({"seed": -1}, "seed: expected a whole number of at least 0"),
        ({"rtol": 1.0}, "rtol: expected a tolerance"),
    ],
)
def test_misuse_names_the_quantity(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rig(**changes)


def test_misuse_of_types_and_points() -> None:
    with pytest.raises(TypeError, match="noise: expected a mapping"):
        rig(noise=[1.0])
    with pytest.raises(TypeError, match="model: expected Model, given str"):
        rig(model="cylinder")
    with pytest.raises(TypeError, match="points: expected Experiments"):
        rig().measure([1.0])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"x0: expected shape \(K, 5\), given \(1, 2\)"):
        rig().measure(fp.Experiments([[1.0, 2.0]], [[1.0]], [1.0]))
    with pytest.raises(ValueError, match="repeats: expected a whole number of at least 1, given 0"):
        rig().measure(POINTS, repeats=0)
    assert repr(rig(noise={"x_v": 1.0, "q": 0.0})) == "VirtualRig(hydraulic_cylinder, measures q, x_v)"
