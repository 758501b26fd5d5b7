"""
Where the triangles go
======================

How many triangles a mesh spends on 100 square kilometres: many in the mountains, few on plains and at sea.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from meshsimp_pymoo import simplify_to

mesh = simplify_to("topobathy", triangles=3000, moves=500_000)
x, y, _ = mesh.points.T
(ax, bx, cx), (ay, by, cy) = (along[mesh.faces].T for along in (x, y))
density = 2e8 / np.abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained")
mesh.plot(left, edges=False, exaggeration=6)
drawn = right.tripcolor(x, y, mesh.faces, density, cmap="inferno", norm=LogNorm(), edgecolors="k", lw=0.1)
right.set(aspect="equal", xlim=left.get_xlim(), ylim=left.get_ylim())
right.axis("off")
figure.colorbar(drawn, ax=[left, right], label="triangles per 100 km²", format="%g", location="bottom", aspect=40)
