"""Profiles of inputs: values within bounds and rates, slopes through them, designs that stay what they are; given inputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fisherpoint as fp
from fisherpoint.design.runs.run_moves import moved_runs
from fisherpoint.design.runs.run_profiles import draw_runs
from fisherpoint.design.runs.run_slopes import linear_rows
from fisherpoint.points.profiles import ActuatorClock, InputProfile
from fisherpoint.points.run_coordinates import RunCoordinates
from oracle import Floats
from sampling_cases import joint, objective_of, problem, region

CLOCK = ActuatorClock(50, 0.02)
SMOOTH: tuple[InputProfile, ...] = (
    fp.Ramps(7),
    fp.Spline(8),
    fp.Multisine(5, bandwidth=(0.5, 10)),
    fp.Multisine((1, 3, 5), bandwidth=(1, 12), crest=2.0),
    fp.Chirp((0.5, 10)),
    fp.Chirp((0.5, 10), sweep="logarithmic"),
)
ALL = (*SMOOTH, fp.PRBS(4), fp.PRBS(6, hold=(2, 5)), fp.Multisine(), fp.Chirp(), fp.Held())


@pytest.mark.parametrize("profile", ALL, ids=repr)
@pytest.mark.parametrize("slew", [np.inf, 0.15])
def test_values_are_within_bounds_and_rates(profile: InputProfile, slew: float) -> None:
    clock, rng = CLOCK._replace(slew=slew), np.random.default_rng(0)
    size = len(profile.numbers(clock))
    drawn = [rng.random(size) if profile.in_order else profile.drawn(rng, clock, 0.4) for _ in range(100)]
    z = np.concatenate([drawn, rng.random((100, size)), rng.integers(0, 2, (100, size))])
    values = profile.shares(z, clock)
    assert values.shape == (300, 50) and values.min() >= 0 and values.max() <= 1
    assert np.abs(np.diff(values, axis=1)).max() <= slew * (1 + 1e-9)
    assert np.ptp(values, axis=1).max() > min(0.5, 0.9 * slew), "some use most of the range, or of what the rate allows"
    for share in (0.0, 0.3, 1.0):
        still = profile.shares(profile.still(share, clock)[None], clock)
        assert np.allclose(still, share, atol=1e-12)


def spectrum(values: Floats) -> Floats:
    return np.abs(np.fft.rfft(values - values.mean())) / len(values) * 2


def test_a_multisine_has_its_harmonics_alone() -> None:
    profile = fp.Multisine((1, 3, 4), bandwidth=(2, 8))
    clock = ActuatorClock(50, 0.02)  # 2 Hz at two periods
    z = np.array([[0.4, 0.0, 0.9, 0.5, 0.7, 0.1, 0.6, 0.3]])
    facts = {one.name: one for one in profile.facts(z[0], clock)}
    found = spectrum(profile.shares(z, clock)[0])
    for order in (1, 3, 4):
        assert facts[f"harmonic {order}: frequency"].value == pytest.approx(2 * order)
        assert found[2 * order] == pytest.approx(facts[f"harmonic {order}: amplitude"].value, rel=1e-9)
    assert np.allclose(np.delete(found, [2, 6, 8]), 0, atol=1e-12)
    assert profile.shares(z, clock).mean() == pytest.approx(facts["offset"].value)


def test_a_multisine_keeps_its_crest_factor() -> None:
    rng = np.random.default_rng(0)
    for crest in (2.0, 2.5):
        profile = fp.Multisine(6, bandwidth=(2, 12), crest=crest)
        clock = ActuatorClock(2000, 1 / 4000)  # a whole period of 2 Hz, densely
        z = np.array([profile.drawn(rng, clock, 0.5) for _ in range(50)])
        z[:, 1] = 0.0
        values = profile.shares(z, clock) - 0.0
        swing = values - values.mean(axis=1, keepdims=True)
        found = np.abs(swing).max(axis=1) / np.sqrt(np.square(swing).mean(axis=1))
        assert found.max() < crest * 1.02 and (found < 0.98 * crest).any() and (crest > 2 or (found > 0.99 * crest).any())


def test_a_chirp_goes_from_one_frequency_to_the_other() -> None:
    for sweep in ("linear", "logarithmic"):
        profile, clock = fp.Chirp((1, 20), sweep=sweep), ActuatorClock(20000, 1e-3)
        z = np.array([[0.5, 0.0, 1.0, 1.0, 0.0]])
        swing = profile.swing(z, clock)[0]
        crossings = clock.t[1:][np.diff(np.sign(swing)) != 0]
        rates = 0.5 / np.diff(crossings)
        expected = 1 + 19 * crossings / 20 if sweep == "linear" else 20 ** (crossings / 20)
        assert np.allclose(rates, (expected[1:] + expected[:-1]) / 2, rtol=0.05)
    level = fp.Chirp((3.0, 3.0), sweep="logarithmic").shares(np.array([[0.5, 0.2, 0.9, 1.0, 0.625]]), CLOCK)[0]
    assert np.allclose(level, 0.5 + 0.5 * np.cos(2 * np.pi * 3 * CLOCK.t)), "a band of one frequency is a sine"


def test_a_prbs_has_both_levels_and_the_correlation_of_noise() -> None:
    profile, clock = fp.PRBS(5, hold=(1, 1)), ActuatorClock(31, 0.1)
    values = profile.shares(np.array([[0.2, 0.7, 0.5, 0.4]]), clock)[0]
    assert set(np.round(values, 12)) == {0.2, 0.7}
    bits = np.where(values > 0.5, 1.0, -1.0)
    correlation = [float(bits @ np.roll(bits, k)) for k in range(31)]
    assert correlation[0] == 31 and set(np.round(correlation[1:])) == {-1.0}


def test_ramps_are_lines_between_knots_and_splines_are_smooth() -> None:
    z = np.random.default_rng(0).random((1, 6))
    clock = ActuatorClock(51, 0.02)
    assert np.allclose(fp.Ramps(6).shares(z, clock)[0], np.interp(np.arange(51), np.arange(0, 51, 10), z[0]))
    weights = fp.Spline(6).weights(clock)
    assert np.allclose(weights.sum(axis=1), 1) and weights.min() >= 0
    assert np.abs(np.diff(weights @ z[0], 3)).max() < 0.02


@pytest.mark.parametrize("profile", SMOOTH, ids=repr)
def test_slopes_go_through_the_map(profile: InputProfile) -> None:
    """Slopes of rows by the numbers are those by held values, times the slopes of these: two routes."""
    changes: Any = {"segments": 25, "sample_every": 0.005}
    smooth = joint(friction="tanh(w/w_s)", constants={"w_s": (0.2, "rad/s")})  # differences over a kink are none
    through, free = (objective_of(problem(region(**changes, **more), smooth)) for more in ({"profile": profile}, {}))
    z = np.random.default_rng(1).uniform(0.2, 0.8, (1, len(through.coordinates)))
    held = (through.coordinates.held(z).u[:, :, 0] + 2.0) / 4.0
    by_numbers, by_values = (linear_rows(one, at, None, True, np.random.default_rng(0)) for one, at in ((through, z), (free, held)))
    assert by_numbers is not None and by_values is not None
    step, d = 1e-6, z.shape[1]
    beside = np.repeat(z, 2 * d, axis=0)
    beside[:d] += step * np.eye(d)
    beside[d:] -= step * np.eye(d)
    u = (through.coordinates.held(beside).u[:, :, 0] + 2.0) / 4.0
    jacobian = (u[:d] - u[d:]) / (2 * step)

    def gradients(linear: Any) -> Floats:
        """Derivatives of F by each number, (d, p, p)."""
        products = np.einsum("mp,dmq->dpq", linear.rows[0, 0], linear.row_slopes[0, :, 0])
        return products + products.swapaxes(1, 2)

    found, wanted = gradients(by_numbers), np.einsum("dn,npq->dpq", jacobian, gradients(by_values))
    for one, other in zip(found, wanted, strict=True):
        assert np.allclose(one, other, rtol=0, atol=1e-2 * np.abs(other).max() + 1e-6 * np.abs(wanted).max())


def test_moves_and_draws_stay_in_the_family() -> None:
    coordinates = RunCoordinates(region(50, profile=fp.Multisine((1, 3), bandwidth=(1, 9))), joint())
    rng = np.random.default_rng(0)
    z = draw_runs(coordinates, 20, rng)
    moved = moved_runs(coordinates, z[0], rng, z)
    assert len(coordinates) == 6 and moved.min() >= 0 and moved.max() <= 1 and len(moved) > 200
    assert np.ptp(coordinates.held(coordinates.quiet[None]).u) == 0


def test_the_best_multisine_is_better_than_random_ones() -> None:
    given = problem(region(25, profile=fp.Multisine(5, bandwidth=(1, 20)), slew={"u": 1.5}, sample_every=0.005))
    design = fp.design_runs(given, n_starts=1, n_candidates=60, seed=0)
    objective = objective_of(given)
    drawn = draw_runs(objective.coordinates, 300, np.random.default_rng(5))
    random = np.linalg.slogdet(objective.judged(objective.tried(drawn, None)).matrices[:, 0])[1]
    assert design.log_det > random.max() + 0.1
    u = design.runs.u[0, :, 0]
    assert np.abs(u).max() <= 2 and np.abs(np.diff(u)).max() <= 1.5 * (1 + 1e-9)

    facts = {one.name: one for one in design.signals["u"][0]}
    turns = 2 * np.pi * 0.02 * np.arange(25)
    anew = np.full(25, facts["offset"].value)
    for order in range(1, 6):
        frequency, amplitude, phase = (facts[f"harmonic {order}: {what}"].value for what in ("frequency", "amplitude", "phase"))
        anew += amplitude * np.cos(turns * frequency + np.radians(phase))
        assert 1 - 1e-9 <= frequency <= 20 * (1 + 1e-9)
    assert np.allclose(anew, u[::4], atol=1e-9), "the report's numbers make the signal"
    assert "Profile of u" in str(design.report())


def test_designs_with_profiles_are_kept(tmp_path: Path) -> None:
    model = joint("u + 0*T", inputs={"u": "N m", "T": "K"})
    heated = region(12, profile={"u": fp.Chirp((2, 10)), "T": fp.Given([290.0, 300.0], t=[0.0, 1.0])})
    design = fp.design_runs(problem(heated, model), n_starts=1, n_candidates=20)
    design.save(tmp_path)
    again = fp.RunDesign.load(tmp_path)
    assert again.signals == design.signals and again.problem.region == heated and hash(again.problem.region) == hash(heated)
    assert np.allclose(design.runs.u[0, ::20, 1], 290 + 10 * 0.02 * np.arange(12))
    assert fp.Runs.from_csv(tmp_path / "design.csv", model) == design.runs
    rows = (tmp_path / "design.csv").read_text().splitlines()
    assert len(rows) == 13 and rows[0].endswith("measured,sample_every")


def test_given_values_run_along() -> None:
    model = joint("u + 0*T", inputs={"u": "N m", "T": "K"})
    coordinates = RunCoordinates(region(4, profile={"T": fp.Given([1.0, 2.0, 3.0, 4.0])}), model)
    runs = coordinates.runs(np.random.default_rng(0).random((2, 4)))
    assert len(coordinates) == 4 and np.array_equal(runs.u[1, ::20, 1], [1, 2, 3, 4])
    moving = RunCoordinates(region(4, bounds={"dt": (0.01, 0.03)}, profile={"T": fp.Given([0.0, 10.0], t=[0.0, 1.0])}), model)
    held = moving.held(np.random.default_rng(0).random((2, 8)))
    assert np.allclose(held.u[:, :, 1], 10 * (held.t - held.dt))


MISTAKES = [
    ({"profile": 3}, "profile: expected one of Held, Ramps, Spline, Multisine, Chirp, PRBS, Given, given int"),
    ({"profile": fp.Chirp(), "bounds": {"dt": (0.01, 0.02)}}, "profile: expected one value of region['dt'], the actuator's clock"),
    ({"profile": fp.Ramps(60)}, "profile.knots: expected at most as many as segments, 50, given 60"),
    ({"profile": {"u": fp.Multisine(5, bandwidth=(1, 30))}}, "profile['u'].bandwidth: expected frequencies up to 25 Hz"),
    ({"profile": fp.Multisine(5, bandwidth=(2, 8))}, "profile.bandwidth: expected room for harmonics 1 to 5, given 2 to 8 Hz"),
    ({"profile": {"u": fp.Chirp()}, "levels": {"u": [0, 1]}}, "levels: expected no input with a profile, given 'u'"),
    ({"profile": {"u": fp.Chirp()}, "constant": ("u",)}, "constant: expected no input with a profile, given 'u'"),
    ({"profile": fp.PRBS(hold=(1, 70))}, "profile.hold: expected at most as many segments as a run has, 50, given 70"),
    ({"profile": {"u": fp.Given(np.zeros(50))}}, "profile['u']: expected no bounds in the region of an input that is given"),
    ({"profile": {"T": fp.Chirp()}}, "profile['T']: expected bounds in the region, or Given values, given none"),
    ({"profile": fp.Given(np.zeros(50))}, "profile: expected a mapping of input to what is given"),
    ({"profile": {"T": fp.Given(np.zeros(49))}}, "profile['T'].values: expected one for each of 50 segments, given 49"),
    (
        {"profile": {"T": fp.Given([1, 2], t=[0, 0.5])}},
        "profile['T'].t: expected times from 0 to the start of the last segment, 0.98",
    ),
]


@pytest.mark.parametrize(("changes", "text"), MISTAKES, ids=[text[:50] for _, text in MISTAKES])
def test_mistakes_of_regions_are_named(changes: Any, text: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        region(**changes)
    assert text in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: fp.Multisine(0), "harmonics: expected"),
        (lambda: fp.Multisine((1, 1)), "harmonics: expected different numbers"),
        (lambda: fp.Multisine(5, crest=1.2), "crest: expected at least 1."),
        (lambda: fp.Multisine(5, bandwidth=(3, 1)), "bandwidth: expected the least first, given 3 and 1"),
        (lambda: fp.Chirp((0, 1)), "bandwidth: expected a positive frequency in Hz"),
        (lambda: fp.Chirp(3.0), "bandwidth: expected a pair"),
        (lambda: fp.Chirp(sweep="square"), "sweep: expected"),
        (lambda: fp.Ramps(1), "knots: expected"),
        (lambda: fp.Spline(3), "knots: expected"),
        (lambda: fp.PRBS(1), "order: expected"),
        (lambda: fp.Given([]), "values: expected"),
        (lambda: fp.Given([1, 2], t=[0, 0]), "t: expected increasing times"),
    ],
)
def test_mistakes_of_profiles_are_named(make: Any, text: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        make()
    assert text in str(error.value) and "\n" not in str(error.value)


def test_what_is_given_must_be_an_input() -> None:
    with pytest.raises(ValueError, match="profile: expected"):
        RunCoordinates(region(50, profile={"Q": fp.Given(np.zeros(50))}), joint())
