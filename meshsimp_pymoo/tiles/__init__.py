"""Models too big for one piece: a height grid is thinned tile by tile, in bounded memory, to one front of whole meshes.

======  ==================================================================================
thin    a tile's own front, with all beyond the tile fixed
gaps    the same of a grid with gaps
moving  the vertices of a larger solution moved, tile by tile
front   the phases: tiles merged by marginal analysis, then cut elsewhere, until one tile
        holds everything; the smallest solutions moved (:mod:`meshsimp_pymoo.search.coarse`)
memory  what the tiles need, and what there is
======  ==================================================================================

The grid, read by windows, is a surface (:mod:`meshsimp_pymoo.surface.grid_surface`), and what comes out is a
:class:`~meshsimp_pymoo.front.Front`.

How the tiles meet. A mesh here is what it is everywhere in this package: the Delaunay triangulation of its vertices,
one function of the subset. So there is no seam that could crack, whatever the tiles did, and no straight line of
vertices that the surface does not need. What a tile may do follows from the same definition: a triangle whose circle
lies in the tile is a triangle of the whole, whatever is kept elsewhere, and a vertex may go while all its triangles are
of that kind. What it changes, and how the error changes, is then exact, and two tiles never touch the same triangle.
The vertices along a shared edge therefore stay as they are in both tiles; they are simplified once, in the next phase,
by the one tile that holds them inside, with all beyond it fixed.
"""
