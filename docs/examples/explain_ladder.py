"""
Down the ladder of sizes
========================

Four rungs of a ladder on a terrain, thinned above and annealed below: the mean error of at most 250, 120, 60 and 30
 triangles.
"""

import matplotlib.pyplot as plt
from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, memetic, plot_mesh, thinning

problem = MeshProblem("jacksboro:11")
nested = thinning(problem.surface)
thinned = Front.from_subsets(problem, [nested.kept(k) for k in range(1, 400)])
annealed = Front.from_result(minimize(problem, memetic(), Moves(1_000_000), seed=1))

figure, rows = plt.subplots(2, 4, figsize=(8.6, 4.9), layout="constrained")
for k, triangles in enumerate((250, 120, 60, 30)):
    for name, front, row in (("thinned", thinned, rows[0]), ("annealed", annealed, rows[1])):
        found = front.best(triangles=triangles)
        plot_mesh(found, row[k], exaggeration=problem.surface.view.exaggeration, edges=True)
        row[k].set_title(f"{name} to {found.triangles}: {found.mean_error:.1f} m", fontsize=9)
