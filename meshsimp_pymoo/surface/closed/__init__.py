"""The closed surface: parts of genus 0 once their holes are closed.

A subset means, for each part, the convex hull of its images on a sphere, without what lies in holes.

Bottom up: `embedding` flattens the original once, `model` holds it in vector order, `distance` says how far a vertex is
from a triangle, `nearest` from a whole mesh, `ground` and `books` are the records of compiled functions, `tracing`
follows polylines along the surface, `lining` makes them its break lines, `evaluate` measures a subset from scratch,
`live` by moves, `free` chooses the edges too, `refit` moves the vertices off the original ones, and `surface` is all
that together, as the search knows it.
"""
