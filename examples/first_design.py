import fisherpoint as fp

model = fp.HydraulicCylinder()
relative_std = dict(a_tau=0.3, b_tau=0.2, m_q=0.05, E_oil=0.2, p_t=0.2, B_v=0.1, c_L=0.3, V_0A=0.1, V_0B=0.1)
prior = fp.GaussianPrior(mean=model.nominal, relative_std=relative_std)
region = fp.ExperimentRegion(
    dict(q=(0.03, 0.27), v=(-0.25, 0.25), p_A=(2e6, 19e6), p_B=(2e6, 19e6), x_v=(-1, 1), u=(-1, 1), dt=(1e-3, 1e-2))
)
noise = {"q": 5e-6, "p_A": 2e4, "p_B": 2e4, "x_v": 1e-3}
problem = fp.DesignProblem(model, prior, region, noise=noise)

design = fp.exchange(problem, n_experiments=12, max_iterations=200)
design.points.to_csv("design.csv", model)
for name, rse in design.under_noise.rse.items():
    print(f"{name:6} known to {prior.std[name] / abs(prior.mean[name]):.0%}, afterwards to {rse:.2%}")
