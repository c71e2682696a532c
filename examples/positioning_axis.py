"""What cannot be known: the drive gain of the positioning axis next to mass and friction."""

from pathlib import Path

import numpy as np

import fisherpoint as fp
from fisherpoint.config import load_config

problem = load_config(Path(__file__).with_name("positioning_axis.toml")).problem()
design = fp.exchange(problem, n_experiments=8, max_iterations=100)
print("with a known drive gain:", {name: f"{rse:.2%}" for name, rse in design.evaluation.rse.items()})

# The same points, with the gain among the parameters: all forces may be scaled by one factor without any change of the position.
model = problem.model.estimate("g")
mean = dict(problem.prior.mean) | {"g": problem.model.constants["g"]}
std = dict(problem.prior.std) | {"g": 0.05 * mean["g"]}
unknown = fp.DesignProblem(model, fp.GaussianPrior(mean=mean, std=std), None, noise_std=problem.noise_std)
evaluation = fp.evaluate_design(unknown, design.points)
print(f"with an unknown one: rank {evaluation.rank} of {len(mean)}")
for direction in evaluation.null_directions:  # in prior standard deviations
    change = np.array([direction[name] * std[name] / mean[name] for name in mean])
    print("not determined: relative changes", dict(zip(mean, (change / np.abs(change).max()).round(3).tolist(), strict=True)))
