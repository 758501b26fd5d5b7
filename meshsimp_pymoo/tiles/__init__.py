"""Models too big for one piece: a height grid is thinned tile by tile, in bounded memory, to one front of whole meshes.

======  ================================================================================================
grid    :class:`~meshsimp_pymoo.tiles.grid.HeightGrid`: samples by windows, from a memory map, a GeoTIFF or in memory
thin    a tile's own front, with all beyond the tile fixed
front   the phases: tiles merged by marginal analysis, then cut elsewhere, until one tile holds everything
coarse  the smallest solutions, whose vertices are moved on the whole grid
weld    the mesh of a solution as one piece or as tiles, and its error over all samples
memory  what the tiles need, and what there is
output  what is left on disk, and how a mesh is taken from it
======  ================================================================================================

How the tiles meet. A mesh here is what it is everywhere in this package: the Delaunay triangulation of its vertices,
one function of the subset. So there is no seam that could crack, whatever the tiles did, and no straight line of
vertices that the surface does not need. What a tile may do follows from the same definition: a triangle whose circle
lies in the tile is a triangle of the whole, whatever is kept elsewhere, and a vertex may go while all its triangles are
of that kind. What it changes, and how the error changes, is then exact, and two tiles never touch the same triangle.
The vertices along a shared edge therefore stay as they are in both tiles; they are simplified once, in the next phase,
by the one tile that holds them inside, with all beyond it fixed.
"""
