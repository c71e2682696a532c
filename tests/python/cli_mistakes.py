"""Deliberate mistakes at the command line: what is typed, and what the one line has to say."""

from __future__ import annotations

from cli_files import (
    CAMPAIGN,
    DATA,
    ENZYME,
    HEADER,
    POINTS,
    ROW,
    RUNS,
    Mistake,
    cylinder,
    data,
    decay,
    edited,
    enzyme,
    points,
    reactor,
)

MISTAKES: dict[str, Mistake] = {
    "an empty output": Mistake("design decay.toml -o ''", ("-o: expected a value, given an empty one",)),
    "an empty output of an equals sign": Mistake("evaluate enzyme.toml points.csv --output=", ("--output: expected a value",)),
    "an empty file": Mistake("design '' -o out", ("arguments: expected a value, given an empty one",)),
    # --- Files that are none -----------------------------------------------------------------------------------------
    "no file": Mistake("design nowhere.toml -o out", ("nowhere.toml: expected a TOML file, found no such file",)),
    "directory for a file": Mistake("design taken -o out", ("taken: expected a TOML file, given a directory",)),
    "binary": Mistake(
        "design b.toml -o out", ("b.toml: expected a TOML file in UTF-8, given other bytes",), {"b.toml": b"\xff\x00\xfe"}
    ),
    "UTF-16": Mistake("design u.toml -o out", ("u.toml: expected a TOML file in UTF-8",), {"u.toml": ENZYME.encode("utf-16")}),
    "JSON for TOML": Mistake(
        "design j.toml -o out",
        ("j.toml: not valid TOML: expected a key and its value, or a table in brackets", "line 1"),
        {"j.toml": '{"model": {"name": "x"}}\n'},
    ),
    "CSV for TOML": Mistake("design data.csv -o out", ("data.csv: not valid TOML: ",)),
    "TOML for CSV": Mistake(
        "evaluate enzyme.toml enzyme.toml", ("enzyme.toml: expected the names of the columns", "given '# Enzyme", "no comments")
    ),
    "unreadable": Mistake("design /proc/self/mem -o out", ("/proc/self/mem: expected a readable TOML file, given: ",)),
    "twice a key": enzyme(
        "n_experiments = 6",
        "n_experiments = 6\nn_experiments = 7",
        "not valid TOML: expected each key once, given one twice",
        "line",
    ),
    "table not closed": enzyme("[design]", "[design", "not valid TOML: ", "line"),
    "no model": Mistake("design n.toml -o out", ("n.toml: model: missing; expected a table",), {"n.toml": "[prior]\n"}),
    "no CSV file": Mistake("evaluate enzyme.toml nowhere.csv", ("nowhere.csv: expected a CSV file of points, found no such file",)),
    "directory for a CSV": Mistake("evaluate enzyme.toml taken", ("taken: expected a CSV file of points, given a directory",)),
    "unreadable CSV": Mistake(
        "evaluate enzyme.toml /proc/self/mem", ("/proc/self/mem: expected a readable CSV file of points, given: ",)
    ),
    # --- The model ---------------------------------------------------------------------------------------------------
    "unknown model": cylinder(
        'name = "hydraulic_cylinder"', 'name = "tank"', 'model.name: expected one of hydraulic_cylinder, given "tank"'
    ),
    "unknown name in an equation": enzyme('"V*s/(K + s)"', '"V*s/(K_m + s)"', "model.", "K_m"),
    "broken equation": enzyme(
        '"V*s/(K + s)"', '"V*s/(K + s"', "model.", "column 5: expected a closing bracket for this (", "given '(K + s'"
    ),
    "missing equation": decay(
        'share = "-k*share"\n', "", "model.equations.share: expected the rate of share as a text, given none"
    ),
    "equation of a stranger": decay(
        'c = "c_0*share"', 'c = "c_0*share"\nd = "k"', "model.equations.d: expected an equation for each of"
    ),
    "constant in a wrong place": cylinder("A_A   =", "A_C   =", "unknown key model.constants.A_C; expected one of A_A,"),
    "key of a state": decay(
        'share = { unit = "1",',
        'share = { units = "1",',
        'unknown key model.states.share.units; expected one of unit, scale, description (did you mean "unit"?)',
    ),
    # --- Prior, noise and region -------------------------------------------------------------------------------------
    "text for a number": enzyme("mean = 212.7", 'mean = "212.7"', 'prior.V.mean: expected a number, given "212.7"'),
    "nan": enzyme("mean = 212.7", "mean = nan", "prior.V.mean: expected a finite number, given nan"),
    "negative std": enzyme("relative_std = 0.20", "std = -1.0", "prior.V.std: expected a number > 0, given -1.0"),
    "both std": enzyme(
        "relative_std = 0.20", "relative_std = 0.2, std = 3.0", "prior.V: expected exactly one of std and relative_std"
    ),
    "percent": enzyme(
        "relative_std = 0.20", "relative_std = 20", "prior.V.relative_std: expected a share of at most 3, such as 0.2 for 20 %"
    ),
    "share of nothing": enzyme("mean = 212.7", "mean = 0.0", "prior.V: expected std instead of relative_std, as the mean is 0"),
    "logarithm of a negative": enzyme("mean = 0.0641,", "mean = -0.0641,", "prior.K: expected a mean > 0 with log = true"),
    "misspelt key": enzyme("relative_std = 0.20", "relativ_std = 0.20", "prior.V.relativ_std", '(did you mean "relative_std"?)'),
    "missing parameter": enzyme("K = { mean", "# K = { mean", "prior.K: missing; expected {mean = "),
    "unknown parameter": enzyme(
        "[noise]", "k_cat = { mean = 1.0, std = 0.1 }\n\n[noise]", "unknown key prior.k_cat; expected one of V, K"
    ),
    "correlation of one": enzyme(
        "[noise]", "[prior_correlation]\nV = 0.5\n\n[noise]", "prior_correlation", "expected two parameters"
    ),
    "correlation above one": enzyme(
        "[noise]",
        '[prior_correlation]\n"V, K" = 1.5\n\n[noise]',
        'prior_correlation."V, K": expected a number < 1, given 1.5',
    ),
    "noise of nothing": enzyme(
        "rate = 10.9", "rate = 0", "noise.rate", "expected a positive standard deviation, or a colored part, given 0"
    ),
    "noise of a stranger": enzyme(
        "rate = 10.9", "rates = 10.9", 'unknown key noise.rates; expected one of rate (did you mean "rate"?)'
    ),
    "measures something else": cylinder('{ std = 2e4, unit = "Pa" }', '{ std = 2e4, unit = "kg" }', "noise.p_A", "Pa", "kg"),
    "no unit": cylinder(
        'm_q   = { mean = 150.0,    relative_std = 0.05, unit = "kg" }',
        'm_q   = { mean = 150.0,    relative_std = 0.05, unit = "kilo" }',
        "prior.m_q",
        "unknown unit 'kilo'",
    ),
    "bounds upside down": enzyme(
        "bounds = [0.0, 1.1]", "bounds = [1.1, 0.0]", "region.s", "expected [lower, upper] with lower <= upper"
    ),
    "one bound": enzyme("bounds = [0.0, 1.1]", "bounds = [1.1]", "region.s", "expected [lower, upper]", "given [1.1]"),
    "bounds of a stranger": enzyme("[region]", "[region]\nv = [0.0, 1.0]", "unknown key region.v; expected one of s"),
    "missing bounds": decay('dt = { bounds = [1e-3, 1e4], unit = "s" }', "", "region.dt: missing; expected [lower, upper] in s"),
    "no duration": decay("bounds = [1e-3, 1e4]", "bounds = [0.0, 1e4]", "region.dt: expected positive durations in s"),
    "no region": Mistake(
        "design wrong.toml -o out",
        ("wrong.toml: region: missing; expected a table with bounds",),
        {"wrong.toml": ENZYME[: ENZYME.index("[region]")]},
    ),
    "constraint of a stranger": cylinder(
        '# constraints = ["p_A + p_B < 30e6"]', 'constraints = ["p_A + p_C < 30e6"]', "region: ", "p_C"
    ),
    "constraint that is none": cylinder(
        '# constraints = ["p_A + p_B < 30e6"]', 'constraints = ["p_A + p_B"]', "region: ", "p_A + p_B"
    ),
    # --- The other tables --------------------------------------------------------------------------------------------
    "unknown table": enzyme("[design]", "[desing]", "unknown key desing; expected one of model", '(did you mean "design"?)'),
    "no points": enzyme("n_experiments = 6", "n_experiments = 0", "design.n_experiments: expected a number >= 1, given 0"),
    "half a point": enzyme("n_experiments = 6", "n_experiments = 6.5", "design.n_experiments: expected a whole number, given 6.5"),
    "unknown method": enzyme("max_iterations = 200", 'method = "best"', 'design.method: expected "paper" or "auto", given "best"'),
    "noise that is not there": Mistake(
        "design wrong.toml -o out",
        ('wrong.toml: design.output_covariance: expected a table [noise] with "noise", given none',),
        {"wrong.toml": edited(ENZYME, ("[noise]\nrate = 10.9\n", ""), ("[design]", '[design]\noutput_covariance = "noise"'))},
    ),
    "parameter to estimate": enzyme(
        "[design]", '[design]\nparameters = ["V", "k"]', "design.parameters: expected names from V, K", 'given "k"'
    ),
    "scenarios of nothing": enzyme(
        "[design]", "[goal]\nscenarios = 8\n[design]", "goal.scenarios: expected only with over, given 8"
    ),
    "six scenarios": enzyme("[design]", '[goal]\nover = "log"\nscenarios = 6\n[design]', "goal.scenarios: expected a power of two"),
    "tolerance": enzyme("[design]", "[design]\nrtol = 2.0", "design.rtol: expected a number <= 0.1, given 2.0"),
    "rule": enzyme(
        "[design]", '[rule]\nkind = "grid"\n\n[design]', 'rule.kind: expected "tensor_grid", "gauss_hermite"', 'given "grid"'
    ),
    "key of another rule": enzyme(
        "[design]", '[rule]\nkind = "sobol"\nlevel = 2\n\n[design]', "rule.level: expected only with kind", 'given "sobol"'
    ),
    "targets in percent": Mistake(
        "campaign wrong.toml -o out",
        ("wrong.toml: campaign.targets: expected a share of at most 1, such as 0.05 for 5 %, given 5",),
        {"wrong.toml": ENZYME + "\n[campaign]\ntargets = 5\n"},
    ),
    "negative cost": Mistake(
        "sweep wrong.toml -L 2:3 -o out",
        ("wrong.toml: cost.per_experiment: expected a number >= 0, given -2",),
        {"wrong.toml": ENZYME + "\n[cost]\nper_experiment = -2\n"},
    ),
    "uncertain of a stranger": cylinder(
        "[region]", "[uncertain]\nT_2 = 1e-4\n\n[region]", "unknown key uncertain.T_2; expected one of"
    ),
    "uncertain and estimated": cylinder(
        "[region]", "[uncertain]\na_tau = 10.0\n\n[region]", "uncertain.a_tau: expected a constant"
    ),
    "no segment": reactor("segments = 8", "segments = 0", "runs.segments: expected a number >= 1, given 0"),
    "all led in": reactor("segments = 8", "segments = 8\nlead_in = 8", "runs.lead_in: expected fewer than all 8 segments, given 8"),
    "levels outside": reactor(
        "segments = 8", "segments = 8\nlevels = { T = [100.0] }", "runs.levels.T: expected values within 300 and 700"
    ),
    "levels in another dimension": reactor(
        "segments = 8",
        'segments = 8\nlevels = { T = { values = [300.0], unit = "bar" } }',
        "runs.levels.T: expected a unit of what is in 'K', given 'bar'",
    ),
    "slew in another dimension": reactor(
        "segments = 8",
        'segments = 8\nslew = { T = { value = 5.0, unit = "K/min" } }',
        "runs.slew.T: expected a unit of what is in 'K', given 'K/min'",
    ),
    "levels that are text": reactor(
        "segments = 8", 'segments = 8\nlevels = { T = "high" }', "runs.levels.T: expected a list of numbers or {values"
    ),
    # --- Options and arguments ---------------------------------------------------------------------------------------
    "unknown command": Mistake(
        "desing enzyme.toml -o out", ("expected a command among design, ", "given desing (did you mean design?)")
    ),
    "unknown option": Mistake(
        "design enzyme.toml -o out --treads 2", ("expected one of its options, given --treads (did you mean --threads?)",)
    ),
    "unknown short option": Mistake("design enzyme.toml -o out -z", ("expected one of its options, given -z",)),
    "no directory": Mistake("design enzyme.toml", ("--output: missing; expected a directory",)),
    "no file to read": Mistake(
        "design -o out", ("FILE.toml: missing; expected a file or directory: Model, prior, sensor noise and region",)
    ),
    "an argument too many": Mistake("design enzyme.toml points.csv -o out", ("expected FILE.toml, given points.csv besides",)),
    "option without a value": Mistake("design enzyme.toml -o", ("-o: expected a value, given none",)),
    "negative seed": Mistake("design enzyme.toml -o out --seed -1", ("--seed: expected a number >= 0, given -1",)),
    "seed in words": Mistake("design enzyme.toml -o out --seed one", ("--seed: expected a whole number, given one",)),
    "no thread": Mistake("design enzyme.toml -o out --threads 0", ("--threads: expected a number >= 1, given 0",)),
    "unknown choice": Mistake("design enzyme.toml -o out --method best", ("--method: expected paper or auto, given best",)),
    "choice of a noise": Mistake(
        "estimate enzyme.toml data.csv -o out --noise none", ("--noise: expected known or estimated, given none",)
    ),
    "no size": Mistake("design enzyme.toml -o out -L 0", ("--size: expected a number >= 1, given 0",)),
    "sizes backwards": Mistake(
        "sweep enzyme.toml -o out -L 6:3", ("--sizes: expected whole numbers", "as 9:30 or 6,9,12; given 6:3")
    ),
    "sizes without end": Mistake(
        "sweep enzyme.toml -o out -L 2:999999999", ("--sizes: expected whole numbers, at most 1000 of them",)
    ),
    "sizes in words": Mistake("sweep enzyme.toml -o out -L few", ("--sizes: expected whole numbers", "given few")),
    "budget in words": Mistake("sweep enzyme.toml -o out -L 2:3 --budget much", ("--budget: expected a number, given much",)),
    "budget that is no number": Mistake(
        "sweep enzyme.toml -o out -L 2:3 --budget nan", ("--budget: expected a cost of at least 0, given nan",)
    ),
    "budget without costs": Mistake(
        "sweep decay.toml -o out -L 2:3 --budget 5", ("decay.toml: cost: missing; expected a table [cost] with --budget",)
    ),
    "more runs than there may be": Mistake(
        "validate enzyme.toml points.csv -o out -n 10000000000", ("--runs: expected a number <= 1000000, given 10000000000",)
    ),
    "seed without noise": Mistake("simulate enzyme.toml points.csv --seed 1", ("--seed: expected only with --noise", "given 1")),
    "noise that is not known": Mistake(
        "simulate wrong.toml points.csv --noise",
        ("wrong.toml: noise: missing; expected the noise of every output with --noise",),
        {"wrong.toml": edited(ENZYME, ("[noise]\nrate = 10.9\n", ""))},
    ),
    "points kept of runs": Mistake(
        "design reactor.toml -o out --keep runs.csv", ("--keep: expected a file with points to design; reactor.toml has",)
    ),
    "method for runs": Mistake(
        "design reactor.toml -o out --method auto", ("--method: expected a file with points to design; reactor.toml has",)
    ),
    "sweep of runs": Mistake(
        "sweep reactor.toml -o out -L 2:3", ("reactor.toml: region: expected bounds of every state", "without a table [runs]")
    ),
    "a file twice": Mistake(
        "estimate enzyme.toml data.csv data.csv -o out", ("DATA.csv: expected each file once, given data.csv twice",)
    ),
    "a design twice": Mistake(
        "compare enzyme.toml points.csv points.csv", ("DESIGN.csv: expected different files, given points.csv, points.csv",)
    ),
    "nothing to open": Mistake("open taken", ("DIR: expected a directory with a report.html", "given taken")),
    "an unknown example": Mistake(
        "init --example batery", ("--example: expected one of alpha_pinene, battery, ", '(did you mean "battery"?), given batery')
    ),
    "an example and a model": Mistake(
        "init decay.toml --example battery", ("--example: expected none beside a model, given battery and decay.toml",)
    ),
    "a model that is none": Mistake("init data.csv", ("data.csv: not valid TOML: ",)),
    "standard input twice": Mistake(
        "evaluate - -", ("-: expected once, as standard input can be read once; given twice",), stdin=ENZYME
    ),
    "nothing on standard input": Mistake(
        "evaluate enzyme.toml -", ("standard input: expected a header and at least one row, given none",), stdin=""
    ),
    "a mistake on standard input": Mistake("design - -o out", ("standard input: not valid TOML: ",), stdin="[model"),
    # --- Tables of points --------------------------------------------------------------------------------------------
    "empty table": points("", "expected a header and at least one row, given none"),
    "header alone": points(HEADER, "expected a header and at least one row, given a header alone"),
    "missing column": points("q,v,p_A\n1,2,3\n", "expected the columns q, v, p_A, p_B, x_v, u, dt; given q, v, p_A"),
    "unknown column": points(
        HEADER.replace("dt", "dt,colour") + ROW.replace("\n", ",1\n"), "expected the columns", "given the unknown colour"
    ),
    "column twice": points(
        HEADER.replace("dt", "dt,q") + ROW.replace("\n", ",1\n"), "expected each column once, given q more than once"
    ),
    "too many entries": points(HEADER + ROW.replace("\n", ",1\n"), "row 1: expected 7 entries, given 8"),
    "word in a column": points(HEADER + ROW + ROW.replace("0.15", "far"), "row 2, column q: expected a number, given 'far'"),
    "gap": points(HEADER + ROW.replace("0.15", ""), "row 1, column q: expected a number, given ''"),
    "infinite": points(HEADER + ROW.replace("0.15", "inf"), "row 1, column q: expected a finite number, given 'inf'"),
    "backwards in time": points(
        HEADER + ROW.replace("0.002", "-0.002"), "row 1, column dt: expected a positive duration in s, given '-0.002'"
    ),
    "wrong unit in a header": points(HEADER.replace("p_A", "p_A [kg]") + ROW, "column p_A", "kg"),
    "comment before the header": points(
        "# of Monday, 10:30, rig 2\n" + HEADER + ROW, "expected the names of the columns", "given '# of Monday", "no comments here"
    ),
    "comment in between": points(HEADER + ROW + "# again, late\n" + ROW, "row 2: expected 7 entries, given 2", "no comments here"),
    "decimal commas": points(HEADER + ROW.replace("0.15", "0,15"), "row 1: expected 7 entries, given 8; use semicolons"),
    "bytes": points(b"\x89PNG\r\n\x1a\n\xff", "expected a table as text, given bytes that are not text: read it by a library"),
    "runs for points": Mistake("evaluate enzyme.toml runs.csv", ("runs.csv: expected the columns", "given run, segment, A")),
    "runs out of order": Mistake(
        "evaluate reactor.toml wrong.csv",
        ("wrong.csv: row 2, column segment: expected the segments of a run in order",),
        {"wrong.csv": RUNS.replace("1,2,", "1,3,")},
    ),
    "kept outside of the region": Mistake(
        "design enzyme.toml -o out --keep wrong.csv",
        ("wrong.csv: expected points of the region, given point 2: s = 5 ppm, above 1.1",),
        {"wrong.csv": "s\n1.1\n5.0\n"},
    ),
    "kept against a constraint": Mistake(
        "design cylinder.toml -o out --keep wrong.csv",
        ("wrong.csv: expected points of the region, given point 1: against the constraint 'p_A + p_B < 30e6'",),
        {"wrong.csv": HEADER + ROW.replace("8e6,8e6", "16e6,16e6")},
    ),
    "more kept than there are": Mistake(
        "design enzyme.toml -o out -L 2 --keep points.csv", ("points.csv: expected fewer points than the design has, 2; given 2",)
    ),
    # --- Measurements ------------------------------------------------------------------------------------------------
    "no output": data(POINTS, "expected the columns s, and of y_rate those that were measured; given none for an output"),
    "misspelt output": data(DATA.replace("y_rate", "y_rat"), "expected the columns", "y_rat"),
    "nothing measured": data("s,y_rate\n1.1,\n0.1,nan\n", "expected at least one measured output, given none in y_rate"),
    "output in words": data(DATA.replace("130", "high"), "row 2, column y_rate: expected a number, given 'high'"),
    "absurd output": data(DATA + "0.2,1e9\n", "row 4, column y_rate: expected at most 1000 times", "is the unit wrong"),
    "data of another model": Mistake(
        "estimate cylinder.toml data.csv -o out",
        ("data.csv: expected the columns q, v", "the file of another model than hydraulic_cylinder"),
    ),
    "t for T": Mistake(
        "estimate reactor.toml wrong.csv -o out",
        ("wrong.csv: expected the column T of the model, given t, which is the time of a record",),
        {"wrong.csv": "A,B,C,t,dt,y_A\n1,0,0,400,0.1,0.5\n"},
    ),
    "record that goes back": Mistake(
        "estimate decay.toml wrong.csv -o out",
        ("wrong.csv: row 3, column t: expected a time after that of the row before, given '1'",),
        {"wrong.csv": "t,y_c\n0,20\n2,19\n1,18\n"},
    ),
    "previous of another model": Mistake(
        "design enzyme.toml -o out --previous cylinder.csv", ("cylinder.csv: expected the columns s; given q, v",)
    ),
    "a logger's names": data(
        "Zeit,Rate\n1,2\n", "the unknown Zeit, Rate", "columns={...}, --column, or [data] of a TOML file names other"
    ),
    "a column that is not there": Mistake(
        "estimate enzyme.toml data.csv -o out --column s=Conc --column y_rate=Rate",
        ("data.csv: expected the columns Conc, Rate, given s, y_rate",),
    ),
    "a column of nothing": Mistake(
        "estimate enzyme.toml data.csv -o out --column rat=y_rate",
        ("unknown key --column.rat; expected one of t, s, dt, rate", 'did you mean "rate"?'),
    ),
    "half a column": Mistake("estimate enzyme.toml data.csv -o out --column s=", ("--column: expected NAME=COLUMN, given s=",)),
    "columns of no data": Mistake(
        "design enzyme.toml -o out --column s=Conc", ("--column: expected beside a file with data, given without",)
    ),
    "columns for runs": Mistake(
        "design reactor.toml -o out --column s=Conc", ("--column: expected a file with points to design; reactor.toml has",)
    ),
    "an unknown name in data": enzyme("[prior]", "[data]\nspeed = 'Rate'\n[prior]", "unknown key data.speed; expected one of t, s"),
    "data that is no name": enzyme("[prior]", "[data]\nrate = 3\n[prior]", "data.rate: expected text in quotes, given 3"),
    # --- Where to write ----------------------------------------------------------------------------------------------
    "campaign where there is a design": Mistake(
        "campaign enzyme.toml -o taken",
        ("--output: expected a directory without a result, given taken, which has design.json", "a campaign needs one of its own"),
    ),
    "a result is there": Mistake(
        "design enzyme.toml -o taken", ("--output: expected a directory without a result, given taken, which has design.json",)
    ),
    "a file for a directory": Mistake(
        "design enzyme.toml -o points.csv", ("--output: expected a directory, given points.csv, which is or lies under a file",)
    ),
    "a directory under a file": Mistake(
        "design enzyme.toml -o points.csv/out", ("--output: expected a directory, given points.csv/out",)
    ),
    "standard output for a directory": Mistake(
        "design enzyme.toml -o -", ("--output: expected a directory, given -, which is standard output",)
    ),
    "a locked directory": Mistake(
        "design enzyme.toml -o /proc/out", ("--output: expected a directory to write to, given /proc/out: ",)
    ),
    "a file is there": Mistake(
        "simulate enzyme.toml points.csv -o there.csv",
        ("--output: expected a file that is not there yet, given there.csv; --force",),
    ),
    "an input is there": Mistake(
        "simulate enzyme.toml points.csv -o points.csv", ("--output: expected a file that is not there yet, given points.csv",)
    ),
    "a directory for a file to write": Mistake(
        "simulate enzyme.toml points.csv -o taken", ("--output: expected a file, given the directory taken",)
    ),
    "a file under nothing": Mistake(
        "simulate enzyme.toml points.csv -o no/where.csv", ("--output: expected a file in a directory to write to", "No such file")
    ),
    "an example is there": Mistake(
        "init --example michaelis_menten -o enzyme.toml", ("--output: expected a file that is not there yet, given enzyme.toml",)
    ),
    # --- Campaigns ---------------------------------------------------------------------------------------------------
    "damaged campaign": Mistake(
        "campaign enzyme.toml -o begun",
        ("begun/campaign.json: expected a whole JSON file",),
        {"begun/campaign.json": '{"format": "fisher'},
    ),
    "another format": Mistake(
        "campaign enzyme.toml -o begun", ("begun/campaign.json: expected a file of format",), {"begun/campaign.json": "{}\n"}
    ),
    "campaign with a time limit": Mistake(
        "campaign wrong.toml -o out",
        ("wrong.toml: design.time_limit: expected none with a campaign",),
        {"wrong.toml": ENZYME.replace("[design]", "[design]\ntime_limit = 5.0") + CAMPAIGN},
    ),
    "data of no campaign": Mistake(
        "campaign enzyme.toml -o out --data nowhere.csv", ("nowhere.csv: expected a CSV file of measurements, found no such file",)
    ),
}
