"""What cannot be known: the drive gain of the positioning axis next to mass and friction."""

from pathlib import Path

import fisherpoint as fp

problem = fp.load_problem(Path(__file__).with_name("positioning_axis.toml"))
design = fp.exchange(problem, n_experiments=8, max_iterations=100, method=fp.ExchangeMethod(references=False))
print("with a known drive gain:", {name: f"{rse:.2%}" for name, rse in design.evaluation.rse.items()})

# With the gain among the parameters all forces may be scaled by one factor, and no position changes.
model = problem.model.estimate("g")
mean = {**problem.prior.mean, "g": problem.model.constants["g"]}
prior = fp.GaussianPrior(mean=mean, std={**problem.prior.std, "g": 0.05 * mean["g"]})
print(f"\nwith an unknown one:\n{fp.identifiability(model, prior, problem.region)}")

# The same is seen in the points: F is singular.
unknown = fp.DesignProblem(model, prior, region=None, noise=problem.noise)
evaluation = fp.evaluate(unknown, design.points)
print(f"\nthe design's points: rank {evaluation.rank} of {len(mean)}")
