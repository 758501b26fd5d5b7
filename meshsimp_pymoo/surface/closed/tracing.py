"""Where polylines in space lie on a closed surface: points along them, and the images of these in the plane.

Between two of its vertices on the surface a line follows it: it goes to the nearest points of those of the straight
piece, as far off them as its ends are. It has points on both sides of where it passes from one original face to
another, so that between these its image is straight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.plane.segments import points_on
from meshsimp_pymoo.surface.closed.embedding import are_poles
from meshsimp_pymoo.surface.closed.model import ClosedModel
from meshsimp_pymoo.surface.closed.nearest import MeshTree, nearest_shares

# Both sides of where a line passes from one face to another, as a share of the face's size.
FINE = 1e-3
# Pieces are halved so often at most.
HALVINGS = 50
# What a foot's share in a corner is at most where it lies on the other side of the triangle.
ON_SIDE = 1e-12
# Images are at least so far inside the triangle of their pole, in the plane.
INSIDE = 2.0**-48


class Feet(NamedTuple):
    """Points of lines, M in all, and where they are on the surface.

    Attributes
    ----------
    points : (M, 3) float array
        The points [model units].
    face : (M,) int array
        The original triangle that each is nearest to.
    foot : (M, 3) float array
        The point of it that is nearest [model units].
    shares : (M, 3) float array
        The barycentric coordinates of that.
    beyond : (M,) bool array
        Whether a point lies over a hole: beyond the rim by more than the tolerance.
    """

    points: FloatArray
    face: IntArray
    foot: FloatArray
    shares: FloatArray
    beyond: BoolArray

    def joined(self, other: Feet) -> Feet:
        """Return both, one after the other."""
        return Feet(*(np.concatenate(parts) for parts in zip(self, other, strict=True)))


class Traced(NamedTuple):
    """Pieces of lines along the surface.

    Attributes
    ----------
    points : (M, 3) float array
        First the V ends of the pieces as they are, then what is between [model units].
    face : (M,) int array
        The original triangle that each lies on.
    xy : (M, 2) float array
        Their images.
    pole : (M,) int array
        The vertex of its pole that a point is taken to because it lies on it, as a row of the model; else -1.
    chains : list of (n,) int array
        The points of each piece, in order from its first end to its second.
    joined : list of (n - 1,) bool array
        Whether the line goes on along the surface from each of these to the next.
    """

    points: FloatArray
    face: IntArray
    xy: FloatArray
    pole: IntArray
    chains: list[IntArray]
    joined: list[BoolArray]

    @property
    def is_passed(self) -> BoolArray:
        """Which points (M,) a line along the surface leads to, or from."""
        found = np.zeros(len(self.points), bool)
        for chain, joined in zip(self.chains, self.joined, strict=True):
            found[chain[1:][joined]] = True
            found[chain[:-1][joined]] = True
        return found


def near_in_space(points: FloatArray, ends: IntArray, reach: float) -> tuple[IntArray, IntArray, FloatArray]:
    """Return which points (V, 3) lie on which pieces (S, 2) between two of them, or as near as ``reach``, and where.

    Ends of a piece, and what is near to them, are not on it. The share of the way is 0 to 1.

    Examples
    --------
    >>> points = np.array([[0.0, 0, 0], [0, 0, 4], [0, 0, 1], [0, 1, 1]])
    >>> [found.tolist() for found in near_in_space(points, np.array([[0, 1]]), 1e-9)]
    [[2], [0], [0.25]]
    """
    # as seen from a side from which no piece is a point but by chance
    side = np.linalg.qr(np.array([[1.0, 2.0, 3.0], [-3.0, 1.0, 5.0], [2.0, -7.0, 1.0]]))[0][:, :2]
    flat = points @ side
    flat -= flat.min(axis=0)
    unit = float(flat.max()) or 1.0
    point, piece = points_on(flat / unit, ends, 1.5 * reach / unit).T
    a, u = points[ends[piece, 0]], points[ends[piece, 1]] - points[ends[piece, 0]]
    length = np.linalg.norm(u, axis=1)
    t = ((points[point] - a) * u).sum(axis=1) / np.maximum(length, 1e-300) ** 2
    away = np.linalg.norm(points[point] - a - t[:, None] * u, axis=1)
    near = (away <= reach) & (t * length > reach) & ((1.0 - t) * length > reach)
    return point[near], piece[near], t[near]


class Tracer:
    """One model's surface, for lines to be traced on.

    Parameters
    ----------
    model : ClosedModel
    tolerance : float
        How far beyond the rim of a hole a point may be [model units].
    most : float
        How far an end may be from the surface, and how far the line may jump on it [model units].
    """

    def __init__(self, model: ClosedModel, tolerance: float, most: float) -> None:
        self.model = model
        self.tolerance, self.most = tolerance, most
        self.faces = model.faces.astype(np.int64)
        self._tree = MeshTree(model.points, self.faces)
        self.is_pole = are_poles(self.faces, model.poles)
        corners = model.points[self.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        double_area = np.linalg.norm(normal, axis=1)
        self.normal = normal / np.maximum(double_area, 1e-300)[:, None]
        self.size = np.sqrt(double_area)
        self.is_border = np.zeros(model.n_vertices, bool)
        self.is_border[model.border] = True
        n = model.n_vertices
        self.rim = np.sort(model.rim.min(axis=1) * n + model.rim.max(axis=1))

    def feet(self, points: FloatArray) -> Feet:
        """Return where points (M, 3) are on the surface."""
        model = self.model
        _, face = self._tree.distances(points)
        a, b, c = (model.points[self.faces[face, k]] for k in range(3))
        shares = nearest_shares(a, b - a, c - a, points)
        foot = shares[:, :1] * a + shares[:, 1:2] * b + shares[:, 2:] * c
        off = points - foot
        along = off - (off * self.normal[face]).sum(axis=1)[:, None] * self.normal[face]
        far = np.linalg.norm(along, axis=1) > self.tolerance
        return Feet(points, face, foot, shares, far & self._on_rim(face, shares))

    def _on_rim(self, face: IntArray, shares: FloatArray) -> BoolArray:
        """Tell whether feet lie on the rim of a hole."""
        if len(self.rim) == 0:
            return np.zeros(len(face), bool)
        corners = self.faces[face]
        found = np.asarray(((shares > 1.0 - ON_SIDE) & self.is_border[corners]).any(axis=1))
        for k in range(3):
            low, high = np.sort(corners[:, [(k + 1) % 3, (k + 2) % 3]], axis=1).T
            key = low * self.model.n_vertices + high
            is_rim = self.rim[np.minimum(np.searchsorted(self.rim, key), len(self.rim) - 1)] == key
            found |= is_rim & (shares[:, k] <= ON_SIDE)
        return found

    def is_on(self, feet: Feet) -> BoolArray:
        """Tell which points are near enough to the surface to be on it."""
        away = np.linalg.norm(feet.points - feet.foot, axis=1)
        return np.asarray((away <= self.most) & ~feet.beyond)

    def traced(self, ends: FloatArray, pieces: IntArray) -> Traced:
        """Return pieces (S, 2) between points (V, 3) along the surface."""
        n = len(ends)
        feet = self.feet(ends)
        on = self.is_on(feet)
        # of each part: its piece, where on it it begins, its ends; and of each point how far the line is off its foot
        piece, start, step = np.arange(len(pieces)), np.zeros(len(pieces)), np.ones(len(pieces))
        a, b = pieces[:, 0].copy(), pieces[:, 1].copy()
        off, whole = ends - feet.foot, np.asarray(on[pieces].all(axis=1))
        done: list[tuple[IntArray, FloatArray, IntArray, IntArray]] = []
        for _ in range(HALVINGS):
            ready = self._are_straight(feet, on, a, b)
            done.append((piece[ready], start[ready], a[ready], b[ready]))
            open_ones = np.flatnonzero(~ready)
            piece, a, b = piece[open_ones], a[open_ones], b[open_ones]
            start, step = start[open_ones], step[open_ones]
            if len(piece) == 0:
                break
            middle = self.feet(0.5 * (feet.points[a] + feet.points[b]))
            m = len(feet.points) + np.arange(len(piece))
            # what is between two ends on the surface follows it, however far the straight piece is from it; what leads
            # away from it ends where it leaves it
            between = np.where(whole[piece, None], 0.5 * (off[a] + off[b]), middle.points - middle.foot)
            most = np.where(whole[piece], self.most, max(self.tolerance, ON_SIDE * self.model.diagonal))
            near = np.linalg.norm(between, axis=1) <= most
            feet, on = feet.joined(middle), np.concatenate([on, near & ~middle.beyond])
            off = np.concatenate([off, between])
            step = 0.5 * step
            piece, start, step = np.tile(piece, 2), np.concatenate([start, start + step]), np.tile(step, 2)
            a, b = np.concatenate([a, m]), np.concatenate([m, b])
        done.append((piece, start, a, b))
        piece, start, a, b = (np.concatenate(parts) for parts in zip(*done, strict=True))
        order = np.lexsort((start, piece))
        piece, a, b = piece[order], a[order], b[order]
        jump = np.linalg.norm(feet.foot[a] - feet.foot[b], axis=1)
        straight = np.linalg.norm(feet.points[a] - feet.points[b], axis=1)
        part = self.model.part[self.faces[feet.face, 0]]
        joined = on[a] & on[b] & (part[a] == part[b]) & (jump <= np.maximum(2.0 * straight, self.most))
        points = np.concatenate([ends, feet.foot[n:] + off[n:]])
        xy, pole = self._images(feet)
        chains, are_joined = [], []
        for first, last in zip(*_spans(piece, len(pieces)), strict=True):
            chain = np.append(a[first:last], b[last - 1])
            chain, along = _without_middles(chain, joined[first:last], feet.face, n)
            chains.append(chain)
            are_joined.append(along)
        return Traced(points, feet.face, xy, pole, chains, are_joined)

    def _are_straight(self, feet: Feet, on: BoolArray, a: IntArray, b: IntArray) -> BoolArray:
        """Tell between which points no more are needed: both lie in one face, or are as near as makes no matter."""
        size = np.minimum(self.size[feet.face[a]], self.size[feet.face[b]])
        near = np.linalg.norm(feet.points[a] - feet.points[b], axis=1) <= FINE * size
        in_one = self._holds(feet.face[a], feet.foot[b]) | self._holds(feet.face[b], feet.foot[a])
        return np.asarray(near | ((on[a] == on[b]) & in_one))

    def _holds(self, face: IntArray, foot: FloatArray) -> BoolArray:
        """Tell whether faces hold points, but for rounding."""
        a, b, c = (self.model.points[self.faces[face, k]] for k in range(3))
        shares = nearest_shares(a, b - a, c - a, foot)
        away = np.linalg.norm(shares[:, :1] * a + shares[:, 1:2] * b + shares[:, 2:] * c - foot, axis=1)
        return np.asarray(away <= ON_SIDE * self.model.diagonal)

    def _images(self, feet: Feet) -> tuple[FloatArray, IntArray]:
        """Return the images (M, 2) of feet, and the vertex of its pole that each is taken to, -1 if it is not on it."""
        model = self.model
        corners = self.faces[feet.face]
        xy = (feet.shares[:, :, None] * model.xy[corners]).sum(axis=1)
        xy = (xy + 1.0) - 1.0
        poles = model.poles[model.part[corners[:, 0]]]
        outside = self.is_pole[feet.face]
        for k in range(3):  # clockwise
            p, q = model.xy[poles[:, k]], model.xy[poles[:, (k + 1) % 3]]
            u, v = q - p, xy - p
            outside |= u[:, 1] * v[:, 0] - u[:, 0] * v[:, 1] <= INSIDE * np.hypot(*u.T)
        away = np.linalg.norm(model.points[poles] - feet.foot[:, None], axis=2)
        nearest = poles[np.arange(len(poles)), away.argmin(axis=1)]
        return np.where(outside[:, None], model.xy[nearest], xy), np.where(outside, nearest, -1)


def _spans(number: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Return from where to where each of n numbers stands in an ascending array."""
    return np.searchsorted(number, np.arange(n)), np.searchsorted(number, np.arange(n), side="right")


def _without_middles(chain: IntArray, joined: BoolArray, face: IntArray, n_ends: int) -> tuple[IntArray, BoolArray]:
    """Leave out the points between two others of the same face, if all are joined."""
    same = face[chain[1:]] == face[chain[:-1]]
    middle = np.zeros(len(chain), bool)
    middle[1:-1] = (same & joined)[1:] & (same & joined)[:-1] & (chain[1:-1] >= n_ends)
    rest = np.flatnonzero(~middle)
    return chain[rest], joined[rest[1:] - 1]
