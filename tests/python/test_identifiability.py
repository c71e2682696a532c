"""Which combinations of parameters no experiment could tell, for models of which the answer is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from conftest import random_points
from defaults import MODEL, NAMES, PRIOR
from fisherpoint.information.identifiability_domain import default_region
from fisherpoint.information.null_space import column_scaled_svd, pivots, reduced_basis
from fisherpoint.information.sensitivity_stack import _agree

TANKS = ["-k1*sqrt(h1) + k4*u", "k2*sqrt(h1) - k3*sqrt(h2)"]
WEIR = ["-k1*sqrt(h1) + k4*u - k5*max(h1 - level, 0)", "k2*sqrt(h1) - k3*sqrt(h2) + k5*max(h1 - level, 0)"]
NOMINAL = {"k1": 0.5, "k2": 0.4, "k3": 0.3, "k4": 0.2, "k5": 1.0}
LEVELS = fp.ExperimentRegion({"h1": (0.3, 1.0), "h2": (0.3, 1.0), "u": (0.0, 3.0), "dt": (0.5, 2.0)})


def tanks(f: list[str], parameters: str, g: str = "h2", **constants: float) -> fp.SymbolicModel:
    names = parameters.split()
    nominal = {name: NOMINAL[name] for name in names}
    states = {"h1": "m", "h2": "m"}
    return fp.SymbolicModel(f, [g], states, {"u": "V"}, dict.fromkeys(names, "1"), {"y": "m"}, constants=constants, nominal=nominal)


def static(*g: str, **nominal: float) -> fp.SymbolicModel:
    return fp.SymbolicModel([], g, {}, {"u": "1"}, dict.fromkeys(nominal, "1"), nominal=nominal)


# --- the cascaded tanks ---------------------------------------------------------------------------------------------------


def test_the_tanks_have_one_null_direction_where_the_upper_start_is_not_known() -> None:
    found = fp.identifiability(tanks(TANKS, "k1 k2 k3 k4"), region=LEVELS, unknown_start=["h1"])
    assert not found.identifiable and found.rank == 3
    (text,), (components,) = found.null_directions, found.null_components
    assert text == (
        "k1 up 1 %, k2 down 1 %, k4 up 2 %, the start of h1 up 2 %: no output changes; only k1*k2 and k4/k1**2 can be identified"
    )
    assert components == pytest.approx({"k1": 0.5, "k2": -0.5, "k4": 1.0}, rel=1e-6)
    assert found.weak == () and found.idle == ()
    # Between what is zero and what is not lies a gap of many decades.
    assert found.singular_values[:, 3].max() < 1e-9 and found.singular_values[:, 2].min() > 1e-3


def test_that_direction_is_one_by_simulation() -> None:
    """h1 -> c h1 changes no output, by however much."""
    model, c = tanks(TANKS, "k1 k2 k3 k4"), 1.7
    points = LEVELS.draw(model, 50, seed=1)
    scaled = fp.Experiments(points.x0 * [c, 1.0], points.u, points.dt)
    other = {"k1": 0.5 * c**0.5, "k2": 0.4 * c**-0.5, "k3": 0.3, "k4": 0.2 * c}
    y = fp.simulate(model, points, model.nominal, rtol=1e-11).y
    same = fp.simulate(model, scaled, other, rtol=1e-11).y
    np.testing.assert_allclose(y, same, rtol=1e-9)


@pytest.mark.parametrize(
    ("model", "starts"),
    [
        (tanks(TANKS, "k1 k2 k3 k4"), []),  # x0 known: it has the scale of h1
        (tanks(TANKS, "k1 k2 k3 k4", g="h1 + h2"), ["h1"]),
        (tanks(TANKS, "k1 k2 k3", k4=0.2), ["h1"]),  # so has the pump
        (tanks(TANKS, "k1 k2", k3=0.3, k4=0.2), ["h1"]),
        (tanks([f.replace("k2", "k1") for f in TANKS], "k1 k3 k4"), ["h1"]),
        (tanks(WEIR, "k1 k2 k3 k4", k5=1.0, level=0.6), ["h1"]),
        (tanks(WEIR, "k1 k2 k3 k4 k5", level=0.6), ["h1"]),
        (tanks(WEIR, "k1 k2 k3 k4 k5", level=0.6), ["h1", "h2"]),
    ],
)
def test_what_sets_the_scale_of_the_upper_tank_leaves_no_null_direction(model: fp.Model, starts: list[str]) -> None:
    found = fp.identifiability(model, region=LEVELS, unknown_start=starts)
    assert found.identifiable and found.rank == len(model.parameters) and found.null_directions == ()
    assert found.singular_values[:, -1].min() > 1e-3


def test_an_overflow_that_no_point_reaches_sets_nothing() -> None:
    found = fp.identifiability(tanks(WEIR, "k1 k2 k3 k4 k5", level=9.0), region=LEVELS, unknown_start=["h1"])
    assert found.rank == 3 and len(found.null_directions) == 2
    assert found.null_directions[0] == "k5: no output changes with it" and "k1*k2" in found.null_directions[1]
    assert found.idle == ()  # by structure it reaches the output


# --- combinations with a known form ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("g", "nominal", "text"),
    [
        ("a*b*u", {"a": 2.0, "b": 5.0}, "a up 1 %, b down 1 %: no output changes; only a*b can be identified"),
        ("exp(-a/b*u)", {"a": 2.0, "b": 5.0}, "a up 1 %, b up 1 %: no output changes; only b/a can be identified"),
        ("a*u/b**2", {"a": 2.0, "b": 5.0}, "a up 2 %, b up 1 %: no output changes; only b**2/a can be identified"),
        ("a*u*sqrt(b**3)", {"a": 2.0, "b": 5.0}, "a up 3 %, b down 2 %: no output changes; only a**2*b**3 can be identified"),
        ("sin(u*(a + b))", {"a": 2.0, "b": 5.0}, "a up by 1, b down by 1: no output changes; only a + b can be identified"),
        ("(2*a - b)*u", {"a": 2.0, "b": -5.0}, "a up by 1, b up by 2: no output changes; only b - 2*a can be identified"),
        ("(a + b)*u", {"a": 0.0, "b": 5.0}, "a up by 1, b down by 1: no output changes; only a + b can be identified"),
        ("a*b*c*u", {"a": 2.0, "b": 5.0, "c": -1.0}, None),
    ],
)
def test_products_and_sums_are_named(g: str, nominal: dict[str, float], text: str | None) -> None:
    found = fp.identifiability(static(g, **nominal))
    if text is None:
        assert found.rank == 1 and len(found.null_directions) == 2
        assert all(" up 1 %, " in one and " down 1 %: " in one for one in found.null_directions)
    else:
        assert found.null_directions == (text,) and found.rank == len(nominal) - 1


def test_a_direction_that_is_neither_is_told_at_a_theta() -> None:
    found = fp.identifiability(static("(a + b**2)*u", a=2.0, b=1.0))
    assert found.null_directions == ("a up 1 %, b down 1 %: no output changes, at a = 2, b = 1",)
    found = fp.identifiability(static("(a + b**2)*u", a=2.0, b=3.0))
    assert found.null_directions == ("a up 1 %, b down 0.111 %: no output changes, at a = 2, b = 3",)


def test_directions_are_told_apart() -> None:
    """Two products and a parameter without influence: three directions, each along its own axes."""
    found = fp.identifiability(static("a*b*u + exp(c*d*u) + f", a=2.0, b=3.0, c=0.5, d=0.7, e=1.0, f=4.0))
    assert found.rank == 3 and found.idle == ("e",)
    assert sorted(text.split(": ")[1] for text in found.null_directions) == [
        "no output changes with it",
        "no output changes; only a*b can be identified",
        "no output changes; only c*d can be identified",
    ]
    assert {frozenset(components) for components in found.null_components} == {frozenset("ab"), frozenset("cd"), frozenset("e")}


def test_null_at_one_theta_is_not_null() -> None:
    """k has no influence at the nominal j = 1 alone."""
    found = fp.identifiability(static("k*(j - 1)*u", "j*u", k=2.0, j=1.0))
    assert found.singular_values[0, 1] == 0 and found.identifiable


def test_a_direction_that_hardly_shows_is_weak_not_null() -> None:
    found = fp.identifiability(static("a*u + b*(u + 1e-6*u**2)", a=1.0, b=1.0))
    assert found.identifiable and len(found.weak) == 1
    assert found.weak[0].startswith(("a up 1 %, b down 1 %: singular value", "b up 1 %, a down 1 %: singular value"))
    assert fp.identifiability(static("a*u + b*(u + 1e-2*u**2)", a=1.0, b=1.0)).weak == ()
    assert not fp.identifiability(static("a*u + b*(u + 1e-11*u**2)", a=1.0, b=1.0)).identifiable


# --- the cylinder, priors, regions -----------------------------------------------------------------------------------------


def test_the_cylinder_is_identifiable_in_its_blocks() -> None:
    found = fp.identifiability(MODEL, PRIOR)
    assert found.identifiable and found.rank == 9 and found.weak == () and found.blocks == MODEL.blocks
    assert found.left_out["left_domain"] > 0
    part = fp.identifiability(MODEL, PRIOR, parameters=NAMES[2::-1])
    assert part.parameters == NAMES[:3] and part.identifiable


def test_a_cylinder_of_which_the_mass_alone_scales_the_friction() -> None:
    """With the areas estimated too, forces and mass can only be told up to a factor."""
    model = MODEL.estimate("A_A", "A_B")
    row = fp.SymbolicModel(
        ["v", model.texts[0][1]],
        ["q", "v"],
        [q for q in model.states if q.name in "qv"],
        {"p_A": ("Pa", 1e7), "p_B": ("Pa", 1e7)},
        [q for q in model.parameters if q.name in ("a_tau", "b_tau", "m_q", "A_A", "A_B")],
        nominal={name: model.nominal[name] for name in ("a_tau", "b_tau", "m_q", "A_A", "A_B")},
    )
    found = fp.identifiability(row)
    assert found.rank == 4 and "a_tau up 1 %, b_tau up 1 %, m_q up 1 %, A_A up 1 %, A_B up 1 %" in found.null_directions[0]


def test_the_sensitivity_to_a_free_start_is_that_to_x0() -> None:
    """Against central differences of the start, also across the kink x_v = 0."""
    free = MODEL.free_start("q", "p_A", "x_v")
    assert [q.name for q in free.parameters[-3:]] == ["q_0", "p_A_0", "x_v_0"] and free.nominal["q_0"] == 0
    points = random_points(np.random.default_rng(3), 200)
    theta = np.array(list(free.nominal.values()))
    found = fp.sensitivities(free, points, theta, rtol=1e-11)
    ok, crossed = found.status == fp.Status.ok, found.x[:, 4] * points.x0[:, 4] < 0
    assert ok.sum() > 20 and (ok & crossed).sum() > 5
    for j, (state, step) in enumerate([(0, 1e-7), (2, 10.0), (4, 1e-6)]):
        y = []
        for sign in (1, -1):
            x0 = points.x0.copy()
            x0[:, state] += sign * step
            y.append(fp.simulate(MODEL, fp.Experiments(x0, points.u, points.dt), MODEL.nominal, rtol=1e-12).y)
        difference, s = (y[0] - y[1])[ok] / (2 * step), found.dy_dtheta[ok][:, :, 9 + j]
        assert np.abs(difference - s).max(axis=0) == pytest.approx(0, abs=1e-4 * np.abs(s).max())


def test_a_free_start_gets_a_name_of_its_own() -> None:
    model = fp.SymbolicModel(["-c_0*c"], ["c"], {"c": "1"}, {}, {"c_0": "1"})
    assert [q.name for q in model.free_start("c").parameters] == ["c_0", "c_0_"]
    with pytest.raises(ValueError, match=r"unknown_start: expected names of states, c; given unknown 'b'"):
        model.free_start("b")


def test_a_start_that_is_not_known_hides_what_it_explains() -> None:
    """y = c + b with c' = k u: the offset and the start are one."""
    model = fp.SymbolicModel(["k*u"], ["c + b"], {"c": "1"}, {"u": "1"}, {"k": "1", "b": "1"}, nominal={"k": 2.0, "b": 1.0})
    assert fp.identifiability(model).identifiable
    found = fp.identifiability(model, unknown_start=["c"])
    assert found.null_directions == ("b up 1 %, the start of c with them: no output changes",) and found.rank == 1
    multiplied = fp.SymbolicModel(["k*u*c"], ["b*c"], {"c": "1"}, {"u": "1"}, {"k": "1", "b": "1"}, nominal={"k": 2.0, "b": 1.0})
    found = fp.identifiability(multiplied, unknown_start=["c"])
    assert found.null_directions == ("b up 1 %, the start of c down 1 %: no output changes",)


def test_what_a_start_nearly_explains_is_weak() -> None:
    model = fp.SymbolicModel(["k*u - j*c"], ["c + b"], {"c": "1"}, {"u": "1"}, {"k": "1", "b": "1"}, constants={"j": 1e-5})
    found = fp.identifiability(model, fp.GaussianPrior({"k": 2.0, "b": 1.0}, {"k": 0.2, "b": 0.2}), unknown_start=["c"])
    assert found.identifiable and len(found.weak) == 1 and found.weak[0].startswith("b up 1 %: singular value")


# --- where the numbers are hard ---------------------------------------------------------------------------------------------


def test_a_far_off_quadratic_is_identifiable_and_its_weak_directions_are_whole() -> None:
    """1, u and u**2 are nearly the same at u = 1e4, but not quite: their second difference is 1e-10 of them."""
    quadratic = static("a + b*u + c*u**2", a=1.0, b=2.0, c=3.0)
    found = fp.identifiability(quadratic, region=fp.ExperimentRegion({"u": (1e4, 1e4 + 1)}))
    assert found.identifiable and found.rank == 3 and found.null_directions == ()
    assert 1e-11 < found.singular_values[0, 2] / found.singular_values[0, 0] < 1e-9
    assert found.weak[-1].startswith("a up 1 %, b down 0.0001 %, c up ")
    farther = fp.identifiability(quadratic, region=fp.ExperimentRegion({"u": (1e6, 1e6 + 1)}))
    assert farther.rank == 2 and set(farther.null_components[0]) == {"a", "b", "c"}
    assert farther.null_directions[0].startswith("a up 1 %, b down 1e-06 %, c up ")


def decays(t_1: float, t_2: float) -> fp.SymbolicModel:
    nominal = {"T_1": t_1, "T_2": t_2}
    f, states = ["-x_1/T_1", "-x_2/T_2"], {"x_1": "1", "x_2": "1"}
    return fp.SymbolicModel(f, ["x_1", "x_2"], states, {}, dict.fromkeys(nominal, "s"), {"a": "1", "b": "1"}, nominal=nominal)


@pytest.mark.parametrize("dt", [(1.0, 1000.0), (1e-2, 1e4), (1e-3, 1e5)])
def test_durations_over_many_decades_tell_what_is_fast_and_what_is_slow(dt: tuple[float, float]) -> None:
    region = fp.ExperimentRegion({"x_1": (0.1, 1.0), "x_2": (0.1, 1.0), "dt": dt})
    found = fp.identifiability(decays(1.0, 1000.0), region=region)
    assert found.identifiable and found.rank_at == found.n_theta == 5 and "inaccurate" not in found.left_out


def test_durations_are_drawn_logarithmically_over_decades_and_stay_inside() -> None:
    model = decays(1.0, 1000.0)
    region = fp.ExperimentRegion({"x_1": (0.1, 1.0), "x_2": (0.1, 1.0), "dt": (1.0, 1000.0)})
    dt = region.draw(model, 3000, seed=0, decades=True).dt
    assert np.histogram(dt, [1, 10, 100, 1000])[0].min() > 900 and dt.min() >= 1 and dt.max() <= 1000
    assert np.mean(region.draw(model, 3000, seed=0).dt < 100) < 0.15  # as candidates are


def test_the_singular_values_that_are_shown_belong_to_the_rank() -> None:
    """At some theta the second parameter has no influence at all."""
    found = fp.identifiability(static("a*u + max(b - 1.2, 0)**2*u**2", a=1.0, b=1.0))
    assert found.rank == 2 and 0 < found.rank_at < found.n_theta / 2
    assert np.median(found.singular_values, axis=0)[1] == 0
    shown = next(line for line in str(found).splitlines() if line.strip().startswith("singular")).split()[1:]
    assert min(map(float, shown)) > 1e-3
    assert f"rank 2 of 2 parameters, at {found.rank_at} of 5 theta" in str(found)


# --- regions, words -----------------------------------------------------------------------------------------------------------


def test_left_out_points_are_counted_and_none_is_an_error() -> None:
    narrow = fp.ExperimentRegion({"h1": (0.3, 1.0), "h2": (0.3, 1.0), "u": (0.0, 3.0), "dt": (0.5, 2.0)}, ["h1 > 0.65"])
    found = fp.identifiability(tanks(TANKS, "k1 k2 k3 k4"), region=narrow, n_points=30)
    assert found.left_out["constraint"] > 30 and found.n_points == 30 and set(found.left_out) == {"constraint"}
    empty = fp.ExperimentRegion({"h1": (0.3, 0.4), "h2": (0.3, 0.4), "u": (0.0, 0.0), "dt": (50.0, 60.0)})
    with pytest.raises(ValueError, match=r"region: expected valid points, given 0 of 2000 drawn \(2000 left_domain\)"):
        fp.identifiability(tanks(TANKS, "k1 k2 k3 k4"), region=empty)


def test_the_prior_tells_theta_and_the_seed_the_draws() -> None:
    model = static("a*b*u", a=2.0, b=5.0)
    prior = fp.GaussianPrior({"a": 1.0, "b": 3.0}, relative_std={"a": 0.9, "b": 0.1}, log=["a"])
    one, same, other = (fp.identifiability(model, prior, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(one.singular_values, same.singular_values)
    assert not np.array_equal(one.singular_values, other.singular_values)
    assert one.null_directions == other.null_directions and one.rank == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parameters": ["c"]}, r"parameters: expected names of a, b; given unknown 'c'"),
        ({"parameters": []}, r"parameters: expected at least one name, given none"),
        ({"unknown_start": ["h"]}, r"unknown_start: expected names of nothing; given unknown 'h'"),
        ({"n_theta": 0}, r"n_theta: expected a whole number of at least 1, given 0"),
        ({"n_points": 1.5}, r"n_points: expected a whole number"),
        ({"prior": fp.GaussianPrior({"a": 1.0}, {"a": 1.0})}, r"prior: expected a value for 'b', given none"),
    ],
)
def test_misuse_is_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fp.identifiability(static("a*b*u", a=2.0, b=5.0), **arguments)


def test_theta_must_be_known() -> None:
    bare = fp.SymbolicModel([], ["a*u"], {}, {"u": "1"}, {"a": "1"})
    with pytest.raises(ValueError, match=r"prior: expected a GaussianPrior, or nominal values of all parameters; given none of a"):
        fp.identifiability(bare)
    with pytest.raises(TypeError, match=r"unknown_start: expected a sequence of names, given 'h1'"):
        fp.identifiability(tanks(TANKS, "k1 k2 k3 k4"), unknown_start="h1")


def test_it_is_shown() -> None:
    found = fp.identifiability(tanks(TANKS, "k1 k2 k3 k4"), region=LEVELS, unknown_start=["h1"])
    text, html = str(found), found._repr_html_()
    assert "locally not identifiable: rank 3 of 4 parameters" in text and "k1*k2" in text
    assert "20 points at 5 theta" in text and "the start of h1" in text
    assert "<table>" in html and "k4/k1**2" in html


# --- what the null space is found by ---------------------------------------------------------------------------------------


def test_a_reduced_basis_spans_the_same_space_along_few_axes() -> None:
    rng = np.random.default_rng(0)
    sparse = np.zeros((3, 8))
    sparse[0, [0, 1]], sparse[1, [2, 3, 4]], sparse[2, 6] = [1, -1], [1, 2, -0.5], 1
    mixed = np.linalg.qr((rng.normal(size=(3, 3)) @ sparse).T)[0].T
    basis = reduced_basis(mixed, pivots(mixed))
    assert np.linalg.matrix_rank(np.vstack([basis, sparse]), tol=1e-9) == 3
    assert sorted((np.abs(basis) > 1e-9).sum(axis=1).tolist()) == [1, 2, 3]


@pytest.mark.parametrize("rows", [2, 4, 30])
def test_the_scaled_svd_has_p_values_for_any_number_of_rows(rows: int) -> None:
    matrix = np.random.default_rng(rows).normal(size=(rows, 4)) * [1e9, 1.0, 1e-9, 0.0]
    values, vectors, length = column_scaled_svd(matrix)
    assert values.shape == (4,) and vectors.shape == (4, 4) and (np.diff(values) <= 0).all()
    np.testing.assert_allclose(vectors @ vectors.T, np.eye(4), atol=1e-12)
    assert (values > 1e-9).sum() == min(rows, 3)
    np.testing.assert_allclose(length, np.linalg.norm(matrix, axis=0))


def test_points_whose_sensitivities_hang_on_the_tolerance_are_left_out() -> None:
    near = np.random.default_rng(0).normal(size=(5, 2, 3, 4)) * np.array([1e9, 1.0, 1e-9, 0.0])
    far = near * (1 + 1e-7)
    far[1, 0, 2, 2] += 1e-3 * np.abs(near[:, :, 2, 2]).max()
    assert _agree(near, far).tolist() == [True, False, True, True, True]


def test_the_default_region_has_either_sign_where_the_model_takes_it() -> None:
    region = default_region(MODEL, MODEL.theta(MODEL.nominal))
    signs = {name: np.sign(low) for name, (low, _) in region.bounds.items()}
    assert signs == {"q": 1, "v": -1, "p_A": 1, "p_B": 1, "x_v": -1, "u": -1, "dt": 1}
    assert region.bounds["p_A"] == (1e6, 1e7) and 1e-5 < region.bounds["dt"][1] < 1e-1


def test_friction_and_an_offset_are_told_apart_by_motion_to_both_sides() -> None:
    nominal = {"Fv": 2.0, "Fc": 0.2, "b": -0.1, "M": 0.9}
    f = ["v", "(u - Fv*v - Fc*sign(v) - b)/M"]
    axis = fp.SymbolicModel(f, ["q"], {"q": "m", "v": "m/s"}, {"u": "V"}, dict.fromkeys(nominal, "1"), nominal=nominal)
    assert fp.identifiability(axis).identifiable
    forward = fp.ExperimentRegion({"q": (0.0, 1.0), "v": (0.5, 1.0), "u": (0.5, 1.0), "dt": (0.01, 0.1)})
    assert fp.identifiability(axis, region=forward).null_directions == (
        "Fc up by 1, b down by 1: no output changes; only Fc + b can be identified",
    )


def test_a_direction_is_looked_for_in_conditions_with_max() -> None:
    rate = "u - p*where(max(h - 0.5, 0) > 0.1, 1, 2)/q"
    model = fp.SymbolicModel([rate], ["h"], {"h": "m"}, {"u": "m/s"}, {"p": "m/s", "q": "1"})
    region = fp.ExperimentRegion({"h": (0.1, 2), "u": (0.1, 1), "dt": (0.1, 1)})
    found = fp.identifiability(model, fp.GaussianPrior({"p": 0.6, "q": 1.0}, std={"p": 0.1, "q": 0.1}), region)
    assert found.null_directions == ("p up 1 %, q up 1 %: no output changes; only q/p can be identified",)
