"""What the reference of the TOML file says of tables and keys; configuration.py has the rest from the program."""

from __future__ import annotations

from fisherpoint.design.file.configuration_tables import OF_FLEET, OF_GOAL, OF_RUNS, OF_SEARCH

INTRODUCTION = """\
# The TOML file

<!-- Written by docs/scripts/configuration.py: change the descriptions in configuration_texts.py, then run `make docs-pages`. -->

A TOML file describes the model, the prior, the sensors, the region and the settings of the command line.
`examples/cylinder.toml` is a commented file to copy. An unknown key, a wrong type or a missing entry is reported in one line that
names the key.

A model's equations are written in the units of its quantities, which are SI units as a rule; a number without a `unit` is in that
of the model. Outside `[model]` another `unit` of the same dimension may be given, as `bounds = [5, 60], unit = "min"` for a `dt` in
s, and is converted; one of another dimension is refused. Temperatures in degC differ from those in K by 273.15, standard deviations
do not. Limits along the way, constraints and `[cost]` are in the model's units whatever those of the bounds, and so are results.

Tables marked *by name* have one entry for each quantity. An entry that only has a value can be written without braces: `x_v = 1e-3`
is short for `x_v = { value = 1e-3 }`, as is `u = [-1, 1]` in `[region]` for its bounds, and `u = "V"` in `[model.inputs]` for its
unit.
"""

OPTIONS = {"goal": OF_GOAL, "design": OF_SEARCH, "runs": OF_RUNS, "fleet": OF_FLEET}
MEANINGS = {table: {name: key.meaning for name, key in keys.items()} for table, keys in OPTIONS.items()}

# Table by table, in the order of the page: the table's introduction, an example, and the meaning of its keys.
TABLES: dict[str, tuple[str, str, dict[str, str]]] = {
    "model": (
        "The model: a built-in one by its name, or equations of your own. With equations, `[model.states]`, `[model.inputs]`,"
        " `[model.parameters]` and `[model.outputs]` list the quantities. [Writing a model](../how_to/models.md#as-text) gives the"
        " rules for equations.",
        '[model]\nname = "tank"\n\n[model.states]\nh = { unit = "m", scale = 0.1, description = "level" }\n\n'
        '[model.inputs]\nu = "m3/s"\n\n[model.parameters]\nk = { unit = "sqrt(m)/s", nominal = 0.05 }\n\n'
        '[model.constants]\narea = { value = 0.02, unit = "m2" }\n\n[model.outputs]\nh = "m"\n\n'
        '[model.equations]\nh = "u/area - k*sqrt(h)"\n',
        {
            "name": "`hydraulic_cylinder`, or with equations any name.",
            "smooth": "Only for the built-in cylinder: widths of the smooth transitions at `v = 0` and `x_v = 0`, by name.",
            "states": "The states, by name.",
            "inputs": "The inputs, by name.",
            "parameters": "The parameters, by name.",
            "constants": "Known constants, by name. Of a built-in model: those that differ from their default.",
            "outputs": "The outputs, by name. An output with the name of a state and no equation is that state.",
            "definitions": "By name: [intermediate quantities](../how_to/models.md#models-with-many-equations), which equations and"
            " later definitions have by name.",
            "equations": "By name: the rate of each state, and each output that is not simply a state. `t` is the time, where"
            " nothing else has the name; conditions are joined by `and`, `or`, `not`, or by `&`, `|`, `~` with brackets."
            " `delay(u, tau)` is an input with a [dead time](../how_to/dead_time.md), and a state in an output that is late.",
            "domain": "Expressions that have to stay positive.",
            "resets": 'By condition, such as `"x < 0"`: the states that get new values where it becomes true, with their equations,'
            ' as `{ v = "-e*v" }`. [What they do](../how_to/models.md#memory-relays-stops-modes). Or by times, such as'
            ' `"every 5 ms"` or `"each segment"`. [When they come](../how_to/updates.md).',
            "check_units": "Whether a warning names places of the equations where"
            " [units do not fit](../how_to/models.md#units-that-do-not-fit).",
        },
    ),
    "model.states": (
        "By name, as are `[model.inputs]`. A text alone is the unit.",
        "",
        {
            "unit": 'The SI unit, `"1"` or `""` for a quantity without dimension.',
            "scale": "Natural size, to which tolerances refer; 1 where it is not given.",
            "description": "A description for reports and plots.",
        },
    ),
    "model.parameters": (
        "By name.",
        "",
        {
            "unit": "As for states.",
            "scale": "Natural size.",
            "description": "As for states.",
            "nominal": "A usual value, which `model.nominal` returns.",
        },
    ),
    "model.constants": (
        "By name. A number alone is the value.",
        "",
        {"value": "The value.", "unit": "Its unit; none means no dimension.", "description": "A description for reports."},
    ),
    "model.outputs": (
        "By name.",
        "",
        {
            "unit": "As for states.",
            "scale": "Natural size; measured values above 1000 times this size are refused.",
            "description": "As for states.",
            "equation": "Its equation, where it has the name of a state but is something else.",
        },
    ),
    "prior": (
        "What is known of each parameter before the experiments, by name. Every parameter of the model needs an entry, with either"
        " `std` or `relative_std`.",
        '[prior]\nc_L = { mean = 2.5e-9, relative_std = 0.30, log = true, unit = "m3/(s sqrt(Pa))" }\n',
        {
            "mean": "The mean.",
            "std": "The standard deviation.",
            "relative_std": "The standard deviation as a share of the mean, 0.2 for 20 %; at most 3.",
            "unit": "The unit, where it is not the model's.",
            "log": "Whether the logarithm is normally distributed; the parameter is then positive.",
        },
    ),
    "prior_correlation": (
        'Correlations of pairs of parameters, between -1 and 1; the key is `"first, second"`. Pairs that are not listed are'
        " uncorrelated.",
        '[prior_correlation]\n"V_0A, V_0B" = 0.5\n',
        {},
    ),
    "noise": (
        "The sensor noise, by name of the output; a number alone is the standard deviation of white noise. With this table only the"
        " outputs that it names are measured; without it all are, and no standard errors are computed."
        " [Noise of sensors](../how_to/noise.md) explains its parts.",
        '[noise]\nq = { std = 5e-6, unit = "m" }\np_A = 2e4\np_B = { std = 2e4, relative = 0.01, limits = [0, 2.5e7] }\n'
        "x_v = { std = 1e-3, colored = { std = 1e-3, correlation_time = 0.5 }, resolution = 1e-3 }\n",
        {
            "std": "Standard deviation of the white part; 0 is allowed beside `colored`.",
            "unit": "The unit of the entry, where it is not the model's.",
            "relative": "Share of the output itself that the white part grows by: the variance is `std`^2 + (`relative` y)^2.",
            "colored": "A part with a memory, `{ std = ..., correlation_time = ... }`, or a list of two; the time is in s.",
            "resolution": "Readings are rounded to multiples of it.",
            "limits": "The least and the largest value that the sensor shows; `-inf` or `inf` for none.",
        },
    ),
    "noise_correlation": (
        'Correlations of the white parts of pairs of outputs, between -1 and 1; the key is `"first, second"`. Pairs that are not'
        " listed are independent.",
        '[noise]\nq = 5e-6\np_A = 2e4\np_B = 2e4\nx_v = 1e-3\n\n[noise_correlation]\n"p_A, p_B" = 0.3\n',
        {},
    ),
    "uncertain": (
        "Standard deviations of constants, and of parameters that are not estimated, by name: of what has one value in all data."
        " [Uncertain constants and starts](../how_to/assumptions.md) explains their effect.",
        '[uncertain]\nT_1 = { value = 2.2e-4, unit = "s" }\n',
        {"value": "The standard deviation.", "unit": "The unit, where it is not the model's."},
    ),
    "varies": (
        "Standard deviations of constants, and of parameters that are not estimated, by name: of what is drawn anew in each point"
        " or run, such as a load or the temperature of the day.",
        '[varies]\np_s = { value = 1, unit = "bar" }\n',
        {"value": "The standard deviation.", "unit": "The unit, where it is not the model's."},
    ),
    "initial_state_std": (
        "Standard deviations by which the true start of a point differs from the planned one, by name of the state.",
        '[initial_state_std]\nv = { value = 2e-3, unit = "m/s" }\n',
        {"value": "The standard deviation.", "unit": "The unit, where it is not the model's."},
    ),
    "local": (
        'Parameters that do not have one value for all data, by name, and whose they are: `"run"` or `"record"`, or a column of'
        " the data with labels, such as `plant` or `day`. [Parameters of a run or a plant](../how_to/local_parameters.md)"
        " explains their effect.",
        '[local]\nm_q = "run"\nc_L = { by = "plant", spread = 2e-10 }\n',
        {
            "by": "Whose the values are. The word may stand alone.",
            "spread": 'Standard deviation between the values, or `"estimated"`. Nothing is known of it where it is left out.',
            "unit": "The unit of the spread, where it is not the model's.",
        },
    ),
    "region": (
        "Which experiments are possible: bounds of every state, every input and, for models with states, `dt`, by name. A pair of"
        " numbers alone gives the bounds. `fisherpoint design` and `fisherpoint campaign` need this table.",
        '[region]\nq = { bounds = [0.03, 0.27], unit = "m" }\nx_v = [-1.0, 1.0]\nconstraints = ["p_A + p_B < 30e6"]\n',
        {
            "bounds": "Lower and upper bound; equal bounds, or one number, fix the value. A pair or a number may stand alone.",
            "unit": "The unit, where it is not the model's.",
            "constraints": "Relations that every point has to satisfy, in the units of the model whatever those of the bounds.",
        },
    ),
    "runs": (
        "Runs of several segments in place of points: with this table `fisherpoint design` and `fisherpoint campaign` look"
        " for runs, and `[region]` bounds the start, the inputs of every segment and its duration."
        " [Designing runs](../how_to/runs.md).",
        "[runs]\nsegments = 48\nlead_in = 4\nslew = { u = 0.5 }\n",
        {
            "segments": "Number of segments of a run.",
            "constant": "Inputs, or `dt`, that stay the same over a run.",
            "shared": "States at the start, constant inputs, or `dt`, that all runs have alike.",
            "levels": "The only values that an input may take, by name; in a unit of their own as"
            ' `{ values = [0, 1], unit = "kW" }`.',
            "slew": "The most that an input may change from one segment to the next, by name; in a unit of its own as"
            ' `{ value = 0.2, unit = "kW" }`.',
            "duration": "The longest that a run may last, s.",
            "lead_in": "Segments at the beginning that are not measured.",
            "sample_every": "The period at which all outputs are measured, whatever the segments are, in s or `{ value = 1, unit ="
            ' "ms" }`, or a list of instants; or these for each output that `[noise]` has, by name.'
            " [Signals](../how_to/signals.md).",
            "samples": "How many samples are chosen of each run; all where it is not given.",
            "rest": "How runs start [at rest](../how_to/runs_at_rest.md), as a table `[runs.rest]`.",
            "profile": "How the values of an input follow from a few numbers, as a table `[runs.profile.NAME]` for each.",
            **MEANINGS["runs"],
        },
    ),
    "runs.profile": (
        "A table for each input that follows a profile; `[region]` has one value of `dt` then, the actuator's clock."
        " [Signals](../how_to/signals.md#classical-excitations).",
        "[region]\ndt = 0.02\n\n[runs]\nsegments = 50\n\n"
        '[runs.profile.u]\nkind = "multisine"\nharmonics = 5\nbandwidth = [1, 10]\n',
        {
            "kind": 'Which one. With "held", the default, every segment has a number of its own. With "given" the input is not'
            " designed, and has no bounds in `[region]`.",
            "knots": 'Number of knots of "ramps", and of coefficients of a "spline".',
            "harmonics": 'How many a "multisine" has, or which, as `[1, 3, 5]`.',
            "bandwidth": 'The lowest and the highest frequency of a "multisine" or "chirp", Hz.',
            "crest": 'The largest crest factor of a "multisine".',
            "sweep": 'How the frequency of a "chirp" moves.',
            "order": 'Length of the shift register of a "prbs".',
            "hold": 'The fewest and the most segments for which a bit of a "prbs" is held.',
            "values": 'What is "given": a value for each segment, or at times, in the model\'s unit.',
            "t": "These times from the start of a run, s.",
        },
    ),
    "runs.rest": (
        "The plant has settled before a run: rates vanish at its start, under a held input, or where a controller keeps states or"
        " outputs. Of states that are found, the middle of their bounds in `[region]` is the guess."
        " [Starts at rest](../how_to/runs_at_rest.md).",
        '[runs]\nsegments = 48\n\n[runs.rest]\nu = { u = 0.0 }\nstates = ["v", "p_A", "p_B", "x_v"]\n',
        {
            "u": "The held input, by name; of an input to be solved for, the guess.",
            "states": "The states of which the rates vanish; the others start within their bounds.",
            "hold": "States at rest that start within their bounds, where a controller keeps them.",
            "outputs": "Values of outputs at the rest, by name, where a controller keeps them.",
            "solve": "Inputs that keep the plant there, which are found: as many as `hold` and `outputs` together.",
        },
    ),
    "fleet": (
        "Several plants that share some parameters and have values of their own of others, those that are `[local]` to a label."
        " With this table `fisherpoint design` has points, or runs, for each of them. Of `[design]` it reads `n_experiments`, which"
        " is that of each plant, `n_candidates`, `max_iterations`, which is `5` here, and `seed`; of `[runs]` `n_runs`."
        " [A fleet](../how_to/local_parameters.md#a-fleet).",
        '[local]\nm_q = "plant"\n\n[fleet]\nplants = ["north", "south", "harbour"]\n',
        {"plants": "How many, or their labels.", **MEANINGS["fleet"]},
    ),
    "rule": (
        "How expectations over the prior are computed; [quadrature](../explanation/quadrature.md) says which kind to take. A file"
        " that gives `levels`, `span` or `edges` without a kind means `tensor_grid`.",
        '[rule]\nkind = "sparse_gauss_hermite"\nlevel = 2\n',
        {
            "kind": "The kind of rule.",
            "levels": "Number of nodes per parameter, one for all or by name.",
            "span": "Half width of the grid in standard deviations.",
            "edges": "Edges of the cells in standard deviations from the mean, one list for all or by name; in place of `levels`"
            " and `span`.",
            "level": "Level of the sparse grid.",
            "n": "Number of points.",
            "seed": "Seed of the scrambling.",
        },
    ),
    "goal": (
        "What the design is to be good for, of points and of runs. [Criteria](../how_to/criteria.md).",
        '[goal]\ncriterion = "c"\nof = "V / K"\n',
        MEANINGS["goal"],
    ),
    "design": (
        "What is estimated, and how long the search may take.",
        '[design]\nn_experiments = 12\nmax_iterations = 200\nparameters = ["a_tau", "b_tau", "m_q"]\n',
        {
            **MEANINGS["design"],
            "output_covariance": "The [form of D](../explanation/output_covariance.md).",
            "parameters": "The parameters to estimate; the others are taken as known.",
            "kinks": 'Whether trajectories may cross kinks; `"exclude"` leaves out points that do.',
            "jumps": "Whether trajectories may cross jumps, or slide along them;"
            ' `"exclude"`, the reading of the paper, leaves out points that meet one.',
            "rtol": "Tolerance of the trajectories, in units of the states' natural sizes.",
            "assumed_covariance": "How the effect of `[varies]` and `[initial_state_std]` is computed: by tangents at the mean,"
            " or by the rule.",
            "along": "Limits along the way: comparisons of states and inputs that whole trajectories keep, as"
            ' `["p_A < 19e6", "abs(v) < 0.4"]`. [What they do](../how_to/limits.md).',
        },
    ),
    "cost": (
        "What experiments cost, in any unit; `fisherpoint sweep` adds it up for designs of every size.",
        "[cost]\nfixed = 120\nper_experiment = 5\nper_second = 0.1\nper_change = { u = 2 }\n",
        {
            "fixed": "Of any design.",
            "per_experiment": "Of each experiment.",
            "per_second": "Of each second that an experiment lasts.",
            "per_change": "Of each change of a state's start or an input from one experiment to the next, by name; the experiments"
            " are sorted so that there are few.",
        },
    ),
    "campaign": (
        "Settings of `fisherpoint campaign`; the search is that of `[design]`, and of `[runs]` where that is given.",
        "[campaign]\nbatch = 6\ntargets = { c_L = 0.02, m_q = 0.01 }\n",
        {
            "batch": "Points per batch, or runs.",
            "targets": "Relative standard errors to reach, 0.05 for 5 %, one for all parameters or by name. Without them it never"
            " ends.",
        },
    ),
    "data": (
        "The columns of files that are called otherwise than here, by the name that each would have: records and measurements of"
        " `fisherpoint estimate`, `campaign` and `--previous` are read by these, and what is not named is left out."
        " [Tables from elsewhere](../how_to/tables.md).",
        '[data]\nt = "Time"\nu = "Spannung [mV]"\ny_q = "Weg"\n',
        {},
    ),
}

SAID: dict[str, str] = {
    "design.output_covariance": '`"noise"` with `[noise]`, else `"region"`',
    "design.parameters": "all",
    "rule.kind": '`"sparse_gauss_hermite"`',
    "cost.fixed": "0",
    "cost.per_experiment": "0",
    "cost.per_second": "0",
    "cost.per_change": "none",
    "campaign.batch": "`6` points, or `1` run",
    "campaign.targets": "none",
    "model.states.scale": "1",
    "model.parameters.scale": "none",
    "model.outputs.scale": "none",
}
"""Defaults that are not the default of an argument."""
