"""
How a search comes closer
=========================

Hypervolume that is missing after so many evaluations: median and range of three seeds. It pays to start from thinning.
"""

import matplotlib.pyplot as plt
import numpy as np
from pymoo.core.callback import Callback
from pymoo.optimize import minimize

import meshsimp_pymoo as ms

problem = ms.MeshProblem("face:300")
ratio = ms.HypervolumeRatio(minimize(problem, ms.memetic(), ms.Moves(300_000), seed=1).F)


class Trace(Callback):
    """Note after every generation how many per cent are missing."""

    def notify(self, algorithm):
        self.data.setdefault("missing", []).append(100 * (1 - ratio(algorithm.opt.get("F"))))


figure, ax = plt.subplots(figsize=(9, 6), layout="constrained")
for name, algorithm, colour in (
    ("NSGA-II v2", ms.nsga2_v2(50), "#7c6f9f"),
    ("NSGA-II v1", ms.nsga2_v1(50), "#c8452f"),
    ("NSGA-II v1 from thinning", ms.nsga2_v1(50, sampling=ms.NestedSubsets()), "#2b5c8a"),
):
    runs = [minimize(problem, algorithm, ("n_gen", 40), seed=s, callback=Trace()) for s in (1, 2, 3)]
    low, median, high = np.quantile([run.algorithm.callback.data["missing"] for run in runs], (0, 0.5, 1), axis=0)
    ax.fill_between(50 * np.arange(1, 41), low, high, color=colour, alpha=0.2, lw=0)
    ax.plot(50 * np.arange(1, 41), median, color=colour, lw=2, label=name)
ax.set(yscale="log", xlabel="evaluations", ylabel="hypervolume that is missing [%]")
ax.set_yticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
ax.minorticks_off()
ax.legend()
