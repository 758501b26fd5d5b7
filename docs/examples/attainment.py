"""
Fronts of six methods
=====================

What each finds on one face; the number is its share of the hypervolume of all of them together.
"""

import matplotlib.pyplot as plt
from pymoo.optimize import minimize

import meshsimp_pymoo as ms

problem = ms.MeshProblem("face:400")
fronts = {
    "NSGA-II v2": minimize(problem, ms.nsga2_v2(), ("n_eval", 6000), seed=1).F,
    "NSGA-II v1": minimize(problem, ms.nsga2_v1(), ("n_eval", 6000), seed=1).F,
    "MOEA/D": minimize(problem, ms.moead(), ("n_eval", 6000), seed=1).F,
    "greedy insertion": ms.greedy_insertion(problem.surface).F,
    "adaptive thinning": ms.thinning(problem.surface).F,
    "memetic": minimize(problem, ms.memetic(), ms.Moves(500_000), seed=1).F,
}
ratio = ms.HypervolumeRatio(ms.merged_front(fronts.values()))

figure, ax = plt.subplots(figsize=(9, 6), layout="constrained")
for (name, F), colour in zip(fronts.items(), plt.get_cmap("plasma_r").resampled(7).colors[1:], strict=True):
    error, triangles = ms.merged_front([F]).T
    ax.step(triangles, error, where="post", color=colour, lw=2, label=f"{name}: {ratio(F):.3f}")
ax.set(xscale="log", yscale="log", xlim=(10, 760), ylim=(4, 5000), xlabel="triangles", ylabel="error [mm]")
ax.set_xticks([10, 20, 50, 100, 200, 500], ["10", "20", "50", "100", "200", "500"])
ax.legend()
