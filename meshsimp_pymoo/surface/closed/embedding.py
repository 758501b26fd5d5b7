"""A mesh of genus 0 flattened once, part by part: every vertex gets an image in the plane, and no face is turned over.

Holes are closed first, for as long as it takes to flatten the rest: each by a round disc of *virtual vertices*, whose
circumference is the rim. It is as fine as the rim there and coarser inwards, so that the surface around is hardly
sheared; one vertex in the middle would draw rims together.

One original face of each part, its *pole*, is the outside: its vertices are the corners of a triangle that holds all
other images. They are part of every mesh, so it is a face at the sharpest corner, which every mesh wants, if there is a
sharp one and nothing gets too small as seen from there; else one at the trunk, from where limbs shrink least. It is
none near a hole, from where the hole would be most of the plane. Each of the others is the weighted mean of those of
its neighbours. With positive weights no face flips (Tutte [1]_); these are the cotangent weights, which make angles in
the plane like those on the surface (Pinkall and Polthier [2]_), bounded from below and above. What is left of the
shearing by the outer triangle is taken away by one affine map.

Seen from the top of a sphere that the plane touches below, these are images on the sphere (stereographically); the
Delaunay triangulation of any of them with the outside as one more triangle is the convex hull there.

Several parts lie beside each other, each in a square of its own.

References
----------
.. [1] W. T. Tutte, "How to draw a graph", Proceedings of the London Mathematical Society 13, 1963.
.. [2] U. Pinkall, K. Polthier, "Computing discrete minimal surfaces and their conjugates", Experimental Mathematics 2,
   1993.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph, linalg

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.compiling.functions import entry
from meshsimp_pymoo.plane.order import unit_square
from meshsimp_pymoo.plane.predicates import orient_sign
from meshsimp_pymoo.surface.edges import Edges

# Weights are at least this share of their median, and at most its inverse.
LEAST_SHARE = 1e-3
# Faces whose images are sheared more than this (the sum of both squared stretches over the area's) say nothing of the
# affine map: they lie where the triangle is cut off by the outside.
MOST_SHEAR = 50.0
# Rounds of the mean that is taken where nearly all faces are such: each is nearer by half.
ROBUST_ROUNDS = 50
# A corner is sharp if the angles of its faces lack so much of a full turn: those of a cube lack pi / 2, of an
# icosahedron pi / 3 [radians]. Seen from there no image may be closer to its neighbour than this.
SHARP, LEAST_EDGE = 1.0, 2.0**-30
# Each ring of the disc that closes a hole has edges so many times as long as the one outside it; one of so few vertices
# has none within.
COARSER, LEAST_RING = 1.4, 6
# A pole is at least this share as far from holes as anything of its part.
AWAY_FROM_HOLES = 0.5
# What is left outside when images are scaled into the unit square.
MARGIN = 2.0**-10


class Embedding(NamedTuple):
    """The images of the vertices.

    Attributes
    ----------
    xy : (N, 2) float array
        In the unit square, multiples of 2**-52; those of a pole are the corners of the hull of its part.
    poles : (P, 3) int array
        For each of P parts the vertices of the face that is its outside, clockwise in the plane.
    n_flipped, n_coinciding : int
        How many faces, those that close holes among them, are flat or flipped in the plane, and how many images
        coincide with another one: it is an embedding if there are none.
    """

    xy: FloatArray
    poles: IntArray
    n_flipped: int
    n_coinciding: int


def embed(points: FloatArray, faces: IntArray, part: IntArray) -> Embedding:
    """Flatten a mesh whose parts are of genus 0 once their holes are closed.

    Parameters
    ----------
    points : (N, 3) float array
        The vertices, in an order that does not depend on the file: the last bits of the images do.
    faces : (T, 3) int array
        The triangles, wound alike.
    part : (N,) int array
        Which part each vertex belongs to: 0, 1, ...

    Returns
    -------
    Embedding
        The images that floating point gives.
    """
    n_parts = int(part.max()) + 1
    discs = discs_in_holes(points, faces)
    closed = np.concatenate([faces, discs.faces])
    corners = np.concatenate([points[faces], discs.corners])
    part = np.concatenate([part, part[discs.rim_vertex]])
    at_holes = np.unique(discs.faces[discs.faces < len(points)])
    away = _away_from(at_holes, points, faces)[faces].min(axis=1)
    side = _cells_a_side(n_parts)
    xy, poles, place = np.empty((len(part), 2)), np.empty((n_parts, 3), np.int64), np.empty(len(part), np.int64)
    for k, (rows, own) in enumerate(zip(_by_number(part), _by_number(part[closed[:, 0]]), strict=True)):
        place[rows] = np.arange(len(rows))
        # seen from a pole beside a hole, the hole would be most of the plane
        n_faces = int(np.searchsorted(own, len(faces)))
        allowed = np.flatnonzero(away[own[:n_faces]] >= AWAY_FROM_HOLES * away[own[:n_faces]].max())
        found, pole = _part_embedded(corners[own], place[closed[own]], n_faces, allowed)
        xy[rows] = (np.array(divmod(k, side)) + found) / side + 1.0 - 1.0  # rounded as all images are
        poles[k] = rows[pole]
    return Embedding(xy[: len(points)], poles, *faults(xy, closed, poles))


def _away_from(sources: IntArray, points: FloatArray, faces: IntArray) -> FloatArray:
    """Return how far it is along edges from each vertex to the nearest of the sources; 0 where there are none."""
    if len(sources) == 0:
        return np.zeros(len(points))
    ends = np.concatenate([faces[:, [k, k - 1]] for k in range(3)])
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    graph = sparse.csr_matrix((np.maximum(length, 1e-300), ends.T), (len(points), len(points)))
    found = csgraph.dijkstra(graph, directed=False, indices=sources, min_only=True)
    return np.where(np.isfinite(found), found, 0.0)


def _cells_a_side(n_parts: int) -> int:
    return int(2 ** int(np.ceil(0.5 * np.log2(n_parts))))


def cell_of(xy: FloatArray, n_parts: int) -> IntArray:
    """Return the number of the cell that each image (N, 2) lies in: the same for those of one part alone."""
    side = _cells_a_side(n_parts)
    column, row = (xy * side).astype(np.int64).T
    return np.asarray(column * side + row)


def _by_number(number: IntArray) -> list[IntArray]:
    """Return which entries have the number 0, which 1, ..., each ascending."""
    return np.split(np.argsort(number, kind="stable"), np.cumsum(np.bincount(number))[:-1])


def _part_embedded(
    corners: FloatArray, faces: IntArray, n_faces: int, allowed: IntArray
) -> tuple[FloatArray, IntArray]:
    """Return the images of one part and its pole, which is among the allowed faces.

    ``corners`` (M, 3, 3) are where the corners of the ``faces`` (M, 3) are, of which the first are its own, the others
    those that close its holes.
    """
    corner = _sharp_face(corners, faces, allowed)
    if corner is not None:
        xy = _embedded(corners, faces, n_faces, corner)
        if shortest_edge(xy, faces) >= LEAST_EDGE and faults(xy, faces, faces[[corner]]) == (0, 0):
            return xy, faces[corner].astype(np.int64)
    trunk = _trunk_face(corners[:n_faces], allowed)
    return _embedded(corners, faces, n_faces, trunk), faces[trunk].astype(np.int64)


class Discs(NamedTuple):
    """What closes the holes of a mesh of N vertices.

    Attributes
    ----------
    faces : (C, 3) int array
        Triangles, wound as the mesh's are; virtual vertices are numbered from N on.
    corners : (C, 3, 3) float array
        Where their corners are: in the planes of discs of their own.
    rim_vertex : (V,) int array
        For each virtual vertex one of the rim of its hole.
    """

    faces: IntArray
    corners: FloatArray
    rim_vertex: IntArray


def discs_in_holes(points: FloatArray, faces: IntArray) -> Discs:
    """Close the holes of a mesh (no two rims meet) by a disc each; see the top of this module."""
    found, corners, rim_vertex = [np.empty((0, 3), np.int64)], [np.empty((0, 3, 3))], [np.empty(0, np.int64)]
    n = len(points)
    for loop in rims(faces):
        along = np.linalg.norm(points[np.roll(loop, -1)] - points[loop], axis=1)
        own, places = _disc(np.maximum(along, LEAST_SHARE * along.mean()))
        rows = np.concatenate([loop, n + np.arange(len(places) - len(loop))])
        found.append(rows[own])
        corners.append(np.column_stack([places, np.zeros(len(places))])[own])
        rim_vertex.append(np.full(len(places) - len(loop), loop[0]))
        n += len(places) - len(loop)
    return Discs(np.concatenate(found), np.concatenate(corners), np.concatenate(rim_vertex))


def rims(faces: IntArray) -> list[IntArray]:
    """Return the rims of holes as vertices in order, the hole on their left, each from its least vertex on."""
    edges = Edges.of(np.asarray(faces, np.int64))
    after = {b: a for a, b in edges.ends(edges.border).tolist()}
    found = []
    for start in sorted(after):
        if start not in after:
            continue
        loop = [start]
        while (vertex := after.pop(loop[-1])) != start:
            loop.append(vertex)
        found.append(np.array(loop))
    return found


def _disc(along: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the triangles (C, 3) and vertices (n, 2) of a disc, the first of them a rim with edges so long."""
    angle = 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(along)[:-1]]) / along.sum()
    radius, step = 1.0, 2.0 * np.pi / len(along)
    ring, n = np.arange(len(along)), len(along)
    faces, places = [], [np.column_stack([np.cos(angle), np.sin(angle)])]
    while len(ring) > LEAST_RING and radius > 2.0 * step:
        radius -= step
        step *= COARSER
        count = max(round(2.0 * np.pi * radius / step), 3)
        inner_angle = 2.0 * np.pi * np.arange(count) / count
        inner = n + np.arange(len(inner_angle))
        faces += _between_rings(ring, angle, inner, inner_angle)
        places.append(radius * np.column_stack([np.cos(inner_angle), np.sin(inner_angle)]))
        ring, angle, n = inner, inner_angle, n + len(inner)
    faces.append(np.column_stack([ring, np.roll(ring, -1), np.full(len(ring), n)]))
    return np.concatenate(faces), np.concatenate([*places, [[0.0, 0.0]]])


def _between_rings(
    outer: IntArray, outer_angle: FloatArray, inner: IntArray, inner_angle: FloatArray
) -> list[IntArray]:
    """Return the triangles between two rings of vertices, by ascending angles: each edge has one."""
    middles = [0.5 * (angle + np.append(angle[1:], angle[0] + 2.0 * np.pi)) for angle in (outer_angle, inner_angle)]
    beside = inner[np.searchsorted(middles[1], middles[0]) % len(inner)]
    across = outer[np.searchsorted(middles[0], middles[1], side="right") % len(outer)]
    return [np.column_stack([outer, np.roll(outer, -1), beside]), np.column_stack([np.roll(inner, -1), inner, across])]


def _embedded(corners: FloatArray, faces: IntArray, n_faces: int, outside: int) -> FloatArray:
    """Return the images of a closed mesh with this face for the outside."""
    pole = faces[outside].astype(np.int64)
    n = int(faces.max()) + 1
    inner = np.ones(n, bool)
    inner[pole] = False
    rows = np.flatnonzero(inner)
    weights = _weights(corners, faces)
    laplacian = (sparse.diags(np.asarray(weights.sum(axis=1)).ravel()) - weights).tocsr()
    # clockwise: the face is seen from its back
    angle = -2.0 * np.pi / 3.0 * np.arange(3)
    hull = np.column_stack([np.cos(angle), np.sin(angle)])
    matrix = laplacian[rows][:, rows].tocsc()
    known = -(laplacian[rows][:, pole] @ hull)
    solver = linalg.splu(matrix)
    found = solver.solve(known)
    found += solver.solve(known - matrix @ found)
    xy = np.empty((n, 2))
    xy[pole], xy[rows] = hull, found
    inside = np.arange(n_faces) != outside
    xy = xy @ _unsheared(corners[:n_faces][inside], xy[faces[:n_faces][inside]])
    xy -= xy[pole].min(axis=0)
    xy *= (1.0 - MARGIN) / xy[pole].max()
    return unit_square(xy)[1]


def faults(xy: FloatArray, faces: IntArray, poles: IntArray) -> tuple[int, int]:
    """Return how many faces are flat or flipped in the plane, and how many images coincide with another one.

    Parameters
    ----------
    xy : (N, 2) float array
        Images, multiples of 2**-52 in the unit square.
    faces : (T, 3) int array
    poles : (P, 3) int array
        The faces that are the outside of a part.
    """
    inside = np.ascontiguousarray(faces[~are_poles(faces, poles)], np.int64)
    return int(_n_flipped(np.ascontiguousarray(xy).ravel(), inside)), _n_coinciding(xy)


def are_poles(faces: IntArray, poles: IntArray) -> BoolArray:
    """Tell which of the faces (T, 3) are among the poles (P, 3)."""
    of_pole = np.full(int(max(faces.max(), poles.max())) + 1, -1)
    of_pole[poles] = np.arange(len(poles))[:, None]
    pole = of_pole[faces]
    return np.asarray((pole[:, 0] >= 0) & (pole == pole[:, :1]).all(axis=1))


def _n_coinciding(xy: FloatArray) -> int:
    return len(xy) - len(np.unique(np.ascontiguousarray(xy).view(np.complex128)))


def shortest_edge(xy: FloatArray, faces: IntArray) -> float:
    """Return the length of the shortest side of a face in the plane."""
    return min(float(np.hypot(*(xy[faces[:, k]] - xy[faces[:, k - 1]]).T).min()) for k in range(3))


@entry
def _n_flipped(xy: np.ndarray, faces: np.ndarray) -> int:
    n = 0
    for k in range(len(faces)):
        a, b, c = faces[k, 0], faces[k, 1], faces[k, 2]
        x, y = xy[2 * c], xy[2 * c + 1]
        n += orient_sign(xy[2 * a] - x, xy[2 * a + 1] - y, xy[2 * b] - x, xy[2 * b + 1] - y, 0.0) <= 0
    return n


def _sharp_face(corners: FloatArray, faces: IntArray, allowed: IntArray) -> int | None:
    """Return the allowed face of the widest angle at the vertex whose angles lack most of a full turn.

    None if none lacks much. Only vertices of allowed faces count.

    However the model is turned or listed it is the same one, but where several are alike.
    """
    n = int(faces.max()) + 1
    sides = [corners[:, (k + 1) % 3] - corners[:, k] for k in range(3)]
    angles = np.empty(faces.shape)
    for k in range(3):
        u, v = sides[k], -sides[k - 1]
        angles[:, k] = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))
    lacks = 2.0 * np.pi - np.bincount(faces.ravel(), angles.ravel(), n)
    is_allowed = np.zeros(n, bool)
    is_allowed[faces[allowed]] = True
    sharpest = int(np.argmax(np.where(is_allowed, lacks, -np.inf)))
    if lacks[sharpest] < SHARP:
        return None
    there = np.where(faces[allowed] == sharpest, angles[allowed], 0.0).max(axis=1)
    return int(allowed[np.argmax(there)])


def _trunk_face(corners: FloatArray, allowed: IntArray) -> int:
    """Return the allowed face nearest to the centroid of the surface."""
    a, b, c = (corners[:, k] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centres = (a + b + c) / 3.0
    away = centres - (area[:, None] * centres).sum(axis=0) / area.sum()
    return int(allowed[np.argmin((away[allowed] ** 2).sum(axis=1))])


def _weights(corners: FloatArray, faces: IntArray) -> sparse.csr_matrix:
    """Return the symmetric matrix (N, N) of bounded cotangent weights of the edges."""
    n = int(faces.max()) + 1
    rows, columns, cotangents = [], [], []
    for k in range(3):
        i, j, opposite = faces[:, k], faces[:, (k + 1) % 3], corners[:, (k + 2) % 3]
        u, v = corners[:, k] - opposite, corners[:, (k + 1) % 3] - opposite
        cross = np.linalg.norm(np.cross(u, v), axis=1)
        rows.append(i)
        columns.append(j)
        cotangents.append(0.5 * (u * v).sum(axis=1) / np.maximum(cross, 1e-300))
    half = sparse.coo_matrix((np.concatenate(cotangents), (np.concatenate(rows), np.concatenate(columns))), (n, n))
    weights = (half + half.T).tocsr()
    median = float(np.median(weights.data))
    # meshes whose angles are mostly obtuse have no such median
    usual = median if median > 0.0 else float(np.abs(weights.data).mean())
    weights.data = np.clip(weights.data, LEAST_SHARE * usual, usual / LEAST_SHARE)
    return weights


def _unsheared(corners: FloatArray, images: FloatArray) -> FloatArray:
    """Return the matrix (2, 2) that images are multiplied by from the right, so that shapes are kept in the mean.

    Faces have their corners (n, 3, 3) in space and (n, 3, 2) in the plane. With J the derivative of the image on one,
    J J^T / det J is the identity where shapes are kept. Its mean over the surface becomes that.
    """
    a, b, c = (corners[:, k] for k in range(3))
    pa, pb, pc = (images[:, k] for k in range(3))
    u, v = b - a, c - a
    length = np.linalg.norm(u, axis=1)
    along = (u * v).sum(axis=1) / np.maximum(length, 1e-300)
    height = np.sqrt(np.maximum((v**2).sum(axis=1) - along**2, 0.0))
    solid = (length > 0.0) & (height > 1e-12 * length)
    first = (pb - pa)[solid] / length[solid, None]
    second = ((pc - pa)[solid] - first * along[solid, None]) / height[solid, None]
    determinant = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    fair = determinant > 1e-300
    J = np.stack([first[fair], second[fair]], axis=2)
    shear = (J @ J.transpose(0, 2, 1)) / determinant[fair][:, None, None]
    area = (length * height)[solid][fair]
    first_map = np.eye(2)
    if area[_is_usual(shear)].sum() < 0.5 * area.sum():
        # from a narrow pole all of the surface looks sheared, and its mean would be that of the odd faces that do not
        first_map = _without_shear(_robust_mean(shear, area))
        shear = first_map @ shear @ first_map
    usual = _is_usual(shear)
    if not usual.any():
        return first_map
    return first_map @ _without_shear((area[usual][:, None, None] * shear[usual]).sum(axis=0))


def _is_usual(shear: FloatArray) -> BoolArray:
    """Tell which of these matrices (n, 2, 2) of determinant 1 are those of faces that say something of all."""
    return np.asarray(np.trace(shear, axis1=1, axis2=2) < MOST_SHEAR)


def _without_shear(mean: FloatArray) -> FloatArray:
    """Return the symmetric matrix of determinant 1 that makes a shear (2, 2) the identity, but for its size."""
    values, vectors = np.linalg.eigh(mean)
    return np.asarray(vectors @ np.diag((values / np.sqrt(values.prod())) ** -0.5) @ vectors.T)


def _robust_mean(shear: FloatArray, area: FloatArray) -> FloatArray:
    """Return a mean of matrices (n, 2, 2) that counts each by how it looks beside the mean, not by its size.

    D. E. Tyler, "A distribution-free M-estimator of multivariate scatter", Annals of Statistics 15, 1987.
    """
    mean = np.eye(2)
    for _ in range(ROBUST_ROUNDS):
        beside = np.einsum("ij,kji->k", np.linalg.inv(mean), shear)
        mean = ((area / beside)[:, None, None] * shear).sum(axis=0)
        mean /= np.sqrt(np.linalg.det(mean))
    return mean
