"""
The front of a terrain
======================

Every mesh for which no other one found is both smaller and more accurate.
"""

from pymoo.optimize import minimize

from meshsimp_pymoo import Front, MeshProblem, Moves, memetic

front = Front.from_result(minimize(MeshProblem("jacksboro:21"), memetic(), Moves(50_000), seed=1))
front.plot()
