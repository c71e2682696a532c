"""Mistakes in the TOML file: a line for every one, with where it is and what was expected."""

from __future__ import annotations

from pathlib import Path

import pytest

import fisherpoint as fp
from config_text import TEXT, rule_of, without, write

config = pytest.importorskip("fisherpoint.design.file.configuration", reason="needs the extras", exc_type=ImportError)


# What is written in place of what, and the line that follows the file's name.
MISTAKES = {
    "candidates": (
        "n_candidates = 50",
        "n_candidates = 1000000000",
        "design.n_candidates: expected a number <= 1000000, given 1000000000",
    ),
    "points": (
        "n_experiments = 12",
        "n_experiments = 1000001",
        "design.n_experiments: expected a number <= 1000000, given 1000001",
    ),
    "iterations": (
        "max_iterations = 400",
        "max_iterations = 10000000000",
        "design.max_iterations: expected a number <= 1000000000, given 10000000000",
    ),
    "method": ("seed = 0 ", 'method = "best" ', 'design.method: expected "paper" or "auto", given "best"'),
    "over": ("[design]", '[goal]\nover = "best"\n\n[design]', 'goal.over: expected "log", "worst" or "cvar", given "best"'),
    "scenarios alone": ("[design]", "[goal]\nscenarios = 8\n\n[design]", "goal.scenarios: expected only with over, given 8"),
    "share of the mean": (
        "[design]",
        '[goal]\nover = "log"\nshare = 0.5\n\n[design]',
        'goal.share: expected only with over = "cvar", given 0.5',
    ),
    "share": ("seed = 0 ", "local = 1.5 ", "design.local: expected a number <= 1, given 1.5"),
    "unit": (
        'unit = "N" }',
        'unit = "kg" }',
        "prior.a_tau.unit: expected a unit of what is in 'N', given 'kg', which measures something else: kg, not kg m/s2",
    ),
    "unit of a constant": (
        'unit = "m2" }',
        'unit = "mm" }',
        "model.constants.A_A.unit: expected a unit of what is in 'm2', given 'mm', which measures something else: m, not m2",
    ),
    "bounds": (
        "[0.03, 0.27]",
        "[0.3, 0.1]",
        "region.q.bounds: expected [lower, upper] with lower <= upper, given [0.3, 0.1]",
    ),
    "one bound": (
        "x_v = [-1.0, 1.0]",
        "x_v = [1.0]",
        "region.x_v.bounds: expected [lower, upper] with lower <= upper, given [1.0]",
    ),
    "no pair": (
        "x_v = [-1.0, 1.0]",
        "x_v = true",
        'region.x_v: expected a pair [lower, upper], a number, or {bounds = [lower, upper], unit = "..."}, given true',
    ),
    "unknown state": (
        "q   = { bounds",
        "qq  = { bounds",
        'unknown key region.qq; expected one of q, v, p_A, p_B, x_v, u, dt, constraints (did you mean "q"?)',
    ),
    "missing state": ("x_v = [-1.0, 1.0]", "", "region.x_v: missing; expected [lower, upper]"),
    "missing parameter": (
        "a_tau = {",
        "# a_tau = {",
        "prior.a_tau: missing; expected {mean = ..., std = ... or relative_std = ...} in N",
    ),
    "missing mean": ("mean = 400.0,", "", "prior.a_tau.mean: missing; expected a value"),
    "text": ("mean = 400.0,", 'mean = "400",', 'prior.a_tau.mean: expected a number, given "400"'),
    "nan": ("mean = 400.0,", "mean = nan,", "prior.a_tau.mean: expected a finite number, given nan"),
    "both std": (
        "relative_std = 0.30, unit",
        "relative_std = 0.3, std = 3, unit",
        'prior.a_tau: expected exactly one of std and relative_std, given {mean = 400.0, relative_std = 0.3, std = 3, unit = "N"}',
    ),
    "percent": (
        "relative_std = 0.30",
        "relative_std = 30",
        "prior.a_tau.relative_std: expected a share of at most 3, such as 0.3 for 30 %, given 30",
    ),
    "share of nothing": (
        "mean = 400.0",
        "mean = 0",
        'prior.a_tau: expected std instead of relative_std, as the mean is 0, given {mean = 0, relative_std = 0.3, unit = "N"}',
    ),
    "logarithm of nothing": (
        "mean = 400.0,    relative_std",
        "log = true, mean = -1, std",
        'prior.a_tau: expected a mean > 0 with log = true, given {log = true, mean = -1, std = 0.3, unit = "N"}',
    ),
    "negative std": ("relative_std = 0.30", "std = -1.0", "prior.a_tau.std: expected a number > 0, given -1.0"),
    "unknown key of a parameter": (
        "relative_std = 0.30",
        "relativ_std = 0.30",
        'unknown key prior.a_tau.relativ_std; expected one of mean, std, relative_std, unit, log (did you mean "relative_std"?)',
    ),
    "no noise": ("x_v = 1e-3", "x_v = 0", "noise.x_v.std: expected a positive standard deviation, or a colored part, given 0"),
    "unknown constant": (
        "A_A   =",
        "A_C   =",
        'unknown key model.constants.A_C; expected one of A_A, A_B, q_min, q_max, p_s, T_1, k_u (did you mean "A_B"?)',
    ),
    "model": (
        'name = "hydraulic_cylinder"',
        'name = "tank"',
        'model.name: expected one of hydraulic_cylinder, given "tank"',
    ),
    "levels": ("levels = 3", "levels = 0", "rule.levels: expected a number >= 1, given 0"),
    "levels by name": (
        "levels = 3",
        "levels = { a_ta = 1, b_tau = 1, m_q = 1, E_oil = 1, p_t = 1, B_v = 1, c_L = 1, V_0A = 1, V_0B = 1 }",
        'unknown key rule.levels.a_ta; expected one of a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B (did you mean "a_tau"?)',
    ),
    "missing level": (
        "levels = 3",
        "levels = { a_tau = 3 }",
        "rule.levels: missing b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B; expected of each a whole number, 1 to keep the "
        "parameter at its mean",
    ),
    "kind of levels": (
        "levels = 3",
        'levels = "many"',
        'rule.levels: expected a whole number, or one for each parameter by name, given "many"',
    ),
    "rule": (
        'kind = "tensor_grid"',
        'kind = "grid"',
        'rule.kind: expected "tensor_grid", "gauss_hermite", "sparse_gauss_hermite", "sobol", "unscented" or "linearized", '
        'given "grid"',
    ),
    "key of another rule": (
        'kind = "tensor_grid"',
        'kind = "gauss_hermite"',
        'rule.span: expected only with kind = "tensor_grid", given "gauss_hermite"',
    ),
    "no kind": (
        'kind = "tensor_grid"\nlevels = 3\nspan = 1.5',
        "level = 2",
        "rule.kind: missing; expected one of tensor_grid, gauss_hermite, sparse_gauss_hermite, sobol, unscented, linearized",
    ),
    "kind of edges": (
        "levels = 3\nspan = 1.5",
        'edges = "few"',
        'rule.edges: expected a list of ascending numbers, or one for each parameter by name, given "few"',
    ),
    "edge by name": (
        "levels = 3\nspan = 1.5",
        "edges = { a_tau = [-1, 1] }",
        "rule.edges: missing b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B; expected of each a list of ascending numbers",
    ),
    "log": ("relative_std = 0.30", "log = 1, relative_std = 0.30", "prior.a_tau.log: expected true or false, given 1"),
    "correlation of one": (
        "\n[noise]",
        "\n[prior_correlation]\nV_0A = 0.5\n[noise]",
        'prior_correlation."V_0A": expected two parameters, as in "V_0A, V_0B"',
    ),
    "correlation of a stranger": (
        "\n[noise]",
        '\n[prior_correlation]\n"V_0A, V_OB" = 0.5\n[noise]',
        "unknown key prior_correlation.V_OB; expected one of a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B "
        '(did you mean "V_0B"?)',
    ),
    "correlation twice": (
        "\n[noise]",
        '\n[prior_correlation]\n"V_0A, V_0B" = 0.5\n"V_0B,V_0A" = 0.5\n[noise]',
        'prior_correlation."V_0B, V_0A": expected each pair once, given twice',
    ),
    "correlation of 1": (
        "\n[noise]",
        '\n[prior_correlation]\n"V_0A, V_0B" = 1.0\n[noise]',
        'prior_correlation."V_0A, V_0B": expected a number < 1, given 1.0',
    ),
    "seed": ("seed = 0 ", "seed = -1 ", "design.seed: expected a number >= 0, given -1"),
    "covariance": (
        "seed = 0 ",
        'output_covariance = "noisy" ',
        'design.output_covariance: expected "noise", "region", "pooled" or "pointwise", given "noisy"',
    ),
    "parameters": (
        "seed = 0 ",
        'parameters = ["a_tau", "mq"] ',
        "design.parameters: expected names from a_tau, b_tau, m_q, E_oil, p_t, B_v, c_L, V_0A, V_0B "
        '(did you mean "m_q"?), given "mq"',
    ),
    "table": (
        "[design]",
        "[desing]",
        "unknown key desing; expected one of model, prior, prior_correlation, noise, noise_correlation, "
        "uncertain, varies, initial_state_std, local, "
        "region, runs, rule, goal, design, cost, campaign, fleet, data "
        '(did you mean "design"?)',
    ),
}


def line_of(path: Path) -> str:
    with pytest.raises(config.ConfigError) as caught:
        config.load_config(path).problem()
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_gets_one_line(tmp_path: Path, mistake: str) -> None:
    old, new, expected = MISTAKES[mistake]
    assert old in TEXT
    assert line_of(write(tmp_path / "run.toml", TEXT.replace(old, new, 1))) == expected


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    """Those of a table that is wrong in itself, those against the model, and those that only the library refuses."""
    changes = {
        "seed = 0 ": "sead = 0 ",
        "span = 1.5": "span = 0.0",
        "x_v = [-1.0, 1.0]": 'x_v = [1.0, -1.0]\nw = "m"',
        "mean = 400.0,": 'mean = "400",',
        'c_L   = { mean = 2.5e-9,   relative_std = 0.30, unit = "': 'c_L   = { mean = 2.5e-9,   relative_std = 0.30, unit = "zz',
        "B_v   = {": "# B_v   = {",
        "\nx_v = 1e-3": "\nxv = 1e-3",
    }
    text = TEXT
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new, 1)
    path = write(tmp_path / "run.toml", text)
    with pytest.raises(config.ConfigError) as caught:
        config.load_config(path)
    assert caught.value.lines == tuple(str(caught.value).splitlines())
    assert [line.removeprefix(f"{path}: ")[:30] for line in caught.value.lines] == [
        "prior.a_tau.mean: expected a n"[:30],
        "region.w: expected a pair [low",
        "rule.span: expected a number >",
        "unknown key design.sead; expec",
        "prior.B_v: missing; expected {",
        "prior.c_L.unit: expected a uni",
        "unknown key noise.xv; expected",
        "unknown key region.w; expected",
        "region.x_v.bounds: expected [l",
    ]

    text = TEXT.replace(rule_of(TEXT), '[rule]\nkind = "sobol"\nn = 1000\n\n')
    text = text.replace('# constraints = ["p_A + p_B < 30e6"]', 'constraints = ["p_A + p_C < 30e6"]')
    with pytest.raises(config.ConfigError) as caught:
        config.load_config(write(path, text))
    assert [line.removeprefix(f"{path}: ")[:8] for line in caught.value.lines] == ["rule.n: ", "region: "]


def test_files_that_are_no_configuration(tmp_path: Path) -> None:
    assert line_of(tmp_path / "none.toml") == "expected a TOML file, found no such file"
    assert line_of(tmp_path) == "expected a TOML file, given a directory"
    assert line_of(write(tmp_path / "broken.toml", "[model\n")).startswith("not valid TOML: ")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    assert line_of(tmp_path / "bytes.toml") == "expected a TOML file in UTF-8, given other bytes"
    with pytest.raises(config.ConfigError) as caught:
        config.load_config(write(tmp_path / "empty.toml", ""))
    assert [line.rpartition(": ")[0].removeprefix(f"{tmp_path / 'empty.toml'}: ") for line in caught.value.lines] == [
        "model",
        "prior",
    ]
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbf" + TEXT.encode())
    assert config.load_problem(tmp_path / "bom.toml").model.name == "hydraulic_cylinder"


def test_what_a_first_model_lacks_is_named_with_its_form(tmp_path: Path) -> None:
    path = write(tmp_path / "mine.toml", '[model]\nstates = ["T"]\nparameters = ["C"]\n[model.equations]\nT = "-C*T"\n')
    with pytest.raises(config.ConfigError) as caught:
        fp.load_model(path)
    units = 'expected a table with a name and its unit for each, such as {q = "m"}, given'
    assert [line.partition("mine.toml: ")[2] for line in caught.value.lines] == [
        'model.name: missing; expected a name for a model with equations, or "hydraulic_cylinder"',
        f'model.states: {units} ["T"]',
        f'model.parameters: {units} ["C"]',
    ]


@pytest.mark.parametrize(
    ("old", "new", "table"),
    [
        ("value = 21e6", "value = 0.1e6", ""),
        ('# constraints = ["p_A + p_B < 30e6"]', 'constraints = ["p_A + p_C < 30e6"]', "region: "),
    ],
)
def test_what_the_library_refuses_names_the_file(tmp_path: Path, old: str, new: str, table: str) -> None:
    assert old in TEXT
    assert table in line_of(write(tmp_path / "run.toml", TEXT.replace(old, new, 1)))


def test_noise_is_needed_for_the_noise_covariance(tmp_path: Path) -> None:
    text = without("noise").replace("seed = 0 ", 'output_covariance = "noise" ')
    expected = 'design.output_covariance: expected a table [noise] with "noise", given none'
    assert line_of(write(tmp_path / "run.toml", text)) == expected


def test_what_only_the_library_refuses_names_the_table(tmp_path: Path) -> None:
    text = TEXT.replace(rule_of(TEXT), '[rule]\nkind = "sobol"\nn = 1000\n\n')
    path = write(tmp_path / "run.toml", text)
    with pytest.raises(config.ConfigError, match=r"run.toml: rule.n: expected a power of two of at most 1048576, given 1000$"):
        config.load_config(path).problem()
    text = TEXT.replace("\n[noise]", '\n[prior_correlation]\n"V_0A, V_0B" = 0.9\n"V_0A, c_L" = -0.9\n"c_L,V_0B" = 0.9\n[noise]')
    path = write(tmp_path / "run.toml", text)
    with pytest.raises(config.ConfigError, match=r"run.toml: prior: covariance: expected a positive definite matrix.*V_0B"):
        config.load_config(path).problem()
