"""
What the search gains
=====================

The front of the search on a scan of a face, over that of the thinning that it begins with, greedy insertion, and the
paper's NSGA-II.
"""

from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, greedy_insertion, memetic, nsga2_v1

problem = MeshProblem("face:1000")
front = Front.from_result(minimize(problem, memetic(), Moves(1_200_000), seed=1))
front.series["NSGA-II v1, 50 generations"] = Front.from_result(minimize(problem, nsga2_v1(), ("n_gen", 50), seed=1)).F
front.series["greedy insertion, worst point"] = greedy_insertion(problem.surface).F
front.plot()
