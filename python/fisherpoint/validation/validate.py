"""`fp.validate`: does a design keep what it promises?"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

from ..basics.checks import check_flag, check_positive_int, check_type
from ..basics.messages import listed
from ..basics.quantity import names_of
from ..basics.values import Array, FrozenMapping
from ..design.compare.compare import named_designs
from ..design.fleet.fleet_design import FleetDesign, labelled
from ..engine.workers import Distributor, Workers, distributed_over
from ..information.local import Local, checked_local
from ..information.problem import DesignProblem
from ..models import Model
from ..noise.models import NoiseOf, checked_noise
from ..noise.sensors import Sensors
from ..points.points_or_runs import Points
from ..points.settings import check_threads
from ..points.status import NoTrajectory
from ..show.progress import Progress, check_progress, following
from .design_validation import DesignValidation
from .fits import Estimator, VirtualExperiments, VirtualFits, together
from .parts import PartWork, sizes_here, sizes_to_send
from .result import Validation
from .truths import Rig, local_scatter, truths_of

MOST_RUNS = 10**6
"""Virtual experiments with each design, past which they count as a slip."""


def validate(
    problem: DesignProblem,
    designs: Any,
    *,
    noise: NoiseOf | None = None,
    runs: int = 1000,
    theta: str | Mapping[str, float] = "prior",
    seed: int = 0,
    truth: Model | Mapping[str, str | Local] | None = None,
    noise_known: bool = True,
    use_prior: bool = False,
    threads: int | None = None,
    workers: Workers | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> Validation:
    """Measure designs virtually many times, estimate the parameters each time, and compare with what the designs promise.

    Every virtual experiment has true parameters, data y(theta) + v with the sensors' noise v, and a fit
    that starts from the prior mean, and goes on from other starts, as `estimate` does, where that ends in no minimum or in a wrong
    one: a search from the true parameters shows which are wrong. Fits of large models, with 400 derivatives of states by parameters
    or more, have trajectories of rtol 1e-7, and end within 1e-4 standard errors of their minimum; others of 1e-9 and 1e-8.

    Parameters
    ----------
    problem : DesignProblem
        With `uncertain`, the constants deviate, once in every virtual experiment, and with `initial_state_std` the start of every
        point, or run; the fits take the covariance that this adds to the outputs at the prior mean. With `local`, each run, or
        plant, has values of its own, which the fits estimate beside what all share; a spread that is to be estimated counts as
        none, as in designs. Values scatter by their spread about the mean. Where none is known, each is drawn from the prior, as if
        that was the spread; or all are at the mean where `theta` is not drawn.
    designs : Experiments, Runs or a design, or a sequence, or a mapping of name to these
        They share the true parameters and the random numbers. Without names they are called "design", or "design 1" and so on.
        A design is of one plant and one day, unless it is a `FleetDesign`, or `Measurements` with labels.
    noise : mapping of output name to float or Noise, or NoiseModel, optional
        The sensor noise, SI units: a number is the standard deviation of white noise. Outputs that are left out are not measured.
        Default: the problem's.
    runs : int
        Number of virtual experiments with each design.
    theta : "prior", "mean", or mapping of parameter name to float
        The truth: drawn from the prior for each virtual experiment, or the same for all; what a mapping leaves out is at the prior
        mean.
        Draws for which the model has no meaning, such as a negative mass, are left out and counted.
    seed : int
        The same seed gives the same figures on any number of threads and workers.
    truth : Model, or mapping of local parameter name to Local, optional
        Makes the data instead of the problem's model, with its own constants: a model error. Or says how far the values of local
        parameters spread in the data, where that is otherwise than the fits reckon with: ``{"m_load": fp.Local("run", spread=2)}``.
    noise_known : bool
        Whether the fits know the noise, or estimate it from their residuals as `estimate` does without `noise`.
    use_prior : bool
        Whether the prior takes part in the fits (maximum a posteriori), and in the promise.
    threads : int, optional
        Default: every core.
    workers : int, Executor or Dask client, optional
        Who computes parts of the virtual experiments (docs/how_to/workers.md): so many processes that are begun here and share the
        threads, an executor of `concurrent.futures`, or a cluster. The figures are the same. Default: this process.
    progress : bool or callable, optional
        True shows a bar, on the terminal and in notebooks; needs rich. A function is called with a `Progress` after each part of
        the virtual experiments, of which the message counts those without a fit.

    Returns
    -------
    Validation
        Ctrl-C returns what there is by then, with fewer `runs` than `requested`.

    Raises
    ------
    TypeError, ValueError
        For misuse, and where each design has a point without a trajectory at the prior mean. Such a design stands beside the others
        as one that promises nothing.
    """
    check_type(problem, DesignProblem, "problem")
    named, labels = _with_labels(designs, problem.model)
    threads = check_threads(threads)
    count, seed = check_positive_int(runs, "runs", most=MOST_RUNS), check_positive_int(seed, "seed", 0)
    noise_known = check_flag(noise_known, "noise_known")
    use_prior = check_flag(use_prior, "use_prior")
    local = problem.local_parameters
    truth, spreads = (None, _true_spreads(truth, local)) if isinstance(truth, Mapping) else (truth, FrozenMapping({}))
    if not noise_known and (known := [name for name, one in local.items() if one.std is not None]):
        raise ValueError(f"noise_known: expected True beside the spread of local parameters, {', '.join(known)}; given False")
    if not noise_known and problem.assumed is not None and problem.assumed.columns:
        raise ValueError("noise_known: expected True beside varies or initial_state_std, given False")
    if truth is not None:
        _check_truth(truth, problem.model)
    of_sensors = _measured_noise(problem, noise)
    if not noise_known and not Sensors.of(of_sensors, names_of(problem.model.outputs)).white:
        raise ValueError(f"noise_known: expected True beside noise that is more than white, {of_sensors!r}; given False")
    check_progress(progress)
    begin = perf_counter()
    thetas, redrawn = truths_of(problem, theta, count, seed)
    rig = Rig.of(problem, truth, of_sensors, local_scatter(problem, spreads, theta == "prior"))
    without: dict[str, NoTrajectory] = {}
    estimators = {}
    with distributed_over(workers, threads) as distributor:
        for name, points in named.items():
            try:
                estimators[name] = _estimator(
                    name, problem, points, of_sensors, noise_known, use_prior, distributor.threads, theta == "prior", labels[name]
                )
            except NoTrajectory as error:
                without[name] = error
        if not estimators:
            name, first = next(iter(without.items()))
            raise ValueError(f"designs[{name!r}]: {first}") from first
        work = PartWork(
            {
                name: VirtualExperiments(estimator, rig, named[name], distributor.threads)
                for name, estimator in estimators.items()
                if estimator.promises
            }
        )
        with following(progress, "virtual experiments") as report:
            fits = _fits(work, thetas, seed, distributor, begin, report) if work.experiments else {}
    made = count if not fits else len(next(iter(fits.values())).truth)
    validations = {}
    for name, points in named.items():
        if name in without:
            why = str(without[name])
            validations[name] = DesignValidation.none(points, problem.estimated, local, problem.prior.std, why)
            continue
        estimator = estimators[name]
        promised = dict(zip(estimator.parameters, estimator.promised_errors.tolist(), strict=True))
        validations[name] = DesignValidation.of(
            points, promised, problem.prior.std, estimator.null_directions, fits.get(name), estimator.local_errors
        )
    described = theta if isinstance(theta, str) else FrozenMapping({key: float(value) for key, value in theta.items()})
    return Validation(
        problem,
        FrozenMapping(validations),
        of_sensors,
        made,
        described,
        seed,
        redrawn,
        truth,
        noise_known,
        use_prior,
        perf_counter() - begin,
        count,
        spreads,
    )


def _with_labels(given: Any, model: Model) -> tuple[dict[str, Points], dict[str, Mapping[str, tuple[str, ...]]]]:
    """Designs by name, and the labels of their points or runs: of a fleet, and of measurements."""

    def one(design: Any) -> Any:
        return labelled(design.points, design.label, len(model.outputs)) if isinstance(design, FleetDesign) else design

    if isinstance(given, Mapping):
        several: Any = {name: one(design) for name, design in given.items()}
    else:
        several = [one(design) for design in given] if isinstance(given, list | tuple) else one(given)
    named = named_designs(several)
    each = several.values() if isinstance(several, Mapping) else several if isinstance(several, list) else [several]
    return named, {name: getattr(design, "labels", {}) for name, design in zip(named, each, strict=True)}


def _estimator(
    name: str,
    problem: DesignProblem,
    points: Points,
    noise: NoiseOf,
    noise_known: bool,
    use_prior: bool,
    threads: int,
    over_prior: bool,
    labels: Mapping[str, tuple[str, ...]],
) -> Estimator:
    try:
        return Estimator.of(problem, points, noise, noise_known, use_prior, None, threads, over_prior, labels)
    except NoTrajectory:
        raise
    except ValueError as error:
        raise ValueError(f"designs[{name!r}]: {error}") from error


def _fits(
    work: PartWork,
    thetas: Array,
    seed: int,
    distributor: Distributor,
    begin: float,
    progress: Callable[[Progress], None] | None,
) -> dict[str, VirtualFits]:
    """The fits of every design, all of the same runs, also where Ctrl-C ends them early.

    Which runs are made together, and where, does not change them.
    """
    done: list[dict[str, VirtualFits]] = []
    made = failed = 0
    if distributor.here:
        sizes = sizes_here(work.most, work.least(distributor.threads))
    else:
        sizes = sizes_to_send(work.most_to_send, len(thetas))
    try:
        for sent in distributor.map(work, work.parts(thetas, seed, sizes), "part {} of the virtual experiments".format):
            count = len(next(iter(sent.values())).reason)
            fits = work.whole(sent, thetas[made : made + count])
            done.append(fits)
            made += count
            failed += sum(int((of.failure != "").sum()) for of in fits.values())
            if progress is not None:
                message = f"{failed} failed" if failed else ""
                progress(Progress(made, len(thetas), None, message, perf_counter() - begin))
    except KeyboardInterrupt:
        if not done:
            raise
    return {name: together([fits[name] for fits in done]) for name in work.experiments}


def _true_spreads(given: Mapping[str, str | Local], local: Mapping[str, Local]) -> FrozenMapping[float]:
    """Standard deviations by which local parameters scatter in the data."""
    found = {}
    for name, one in checked_local(given, local).items():
        if one.by != local[name].by or one.std is None:
            raise ValueError(f"truth[{name!r}]: expected a spread between values of each {local[name].by}, given {one.words}")
        found[name] = one.std
    return FrozenMapping(found)


def _check_truth(truth: Model, model: Model) -> None:
    check_type(truth, Model, "truth")
    for kind in ("states", "inputs", "outputs", "parameters"):
        expected, given = names_of(getattr(model, kind)), names_of(getattr(truth, kind))
        if expected != given:
            raise ValueError(f"truth: expected the {kind} {listed(expected)}; given {listed(given)}")


def _measured_noise(problem: DesignProblem, given: NoiseOf | None) -> NoiseOf:
    """The noise of the outputs that are measured."""
    if given is None and problem.noise is None:
        raise ValueError("noise: expected the sensor noise, which the problem does not have either; given none")
    return checked_noise(problem.noise if given is None else given, names_of(problem.model.outputs))
