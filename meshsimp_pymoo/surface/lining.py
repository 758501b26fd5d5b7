"""How lines become break lines of a model: cut, draped, thinned once, their vertices added, their edges forced.

In this order:

1. Lines are brought into the model's frame. Vertices within ``SNAP`` of a vertex of the model, or of each other, in the
   plane are at its place.
2. What lies outside the projection of the original faces is cut off.
3. A vertex of one line on another (within ``SNAP``) is a vertex of both. Lines that cross otherwise are refused. Where
   a line with heights passes over a vertex of the model (within ``SNAP``) whose height is off by more than the
   tolerance, it has a vertex, and keeps one: else the mesh with that vertex would have left the line.
4. Lines without heights are draped: they get a vertex wherever they cross an edge of the original, so that their
   profile is the surface's.
5. What is between the places where lines meet or end is thinned (`surface.polylines`). Where thinned lines come to
   cross, or pass a vertex of another, vertices are put back until they do so no more.
6. The vertices left that are none of the model's are added, and all are put in vector order again.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import InputError, ModelError, warn_of
from meshsimp_pymoo.plane.emission import SLIVER_HEIGHT
from meshsimp_pymoo.plane.order import vector_order
from meshsimp_pymoo.plane.segments import along_faces, meeting_segments, points_on
from meshsimp_pymoo.reprs import brief
from meshsimp_pymoo.surface.given_lines import lines_in_file_frame, lines_of_word
from meshsimp_pymoo.surface.line_thinning import Chords, thinned_runs
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.model import Mesh, OpenModel
from meshsimp_pymoo.surface.places import highest
from meshsimp_pymoo.surface.polylines import Runs, cut_into_runs
from meshsimp_pymoo.surface.rules import OUTLINE, is_word_for_lines

# What is so near to each other is at one place, as a share of the model's diagonal in the plane; and at one height, as
# a share of its diagonal in space: more than rounding makes of a file's coordinates, less than any survey knows.
SNAP = SLIVER_HEIGHT
# The tolerance of lines that a word names, where nothing is said, as a share of the diagonal in space.
USUAL_TOLERANCE = 1e-3
# Lines that are on average farther from the surface than this many times its relief are in another unit, or datum.
SUSPECT_SHARE = 10.0
# Where a vertex of a line has its height from. Of several at one place the least counts, of equal ones the first.
GIVEN, BETWEEN_GIVEN, DRAPED, BETWEEN_DRAPED = range(4)


@brief
@dataclass(frozen=True, eq=False)
class Polylines:
    """The vertices of polylines one after the other: M in all.

    Attributes
    ----------
    xy : (M, 2) float array
        In the unit square, multiples of 2**-52.
    z : (M,) float array
        Heights [model units]; NaN where they are the surface's and not known yet.
    source : (M,) int array
        GIVEN, ... : where the heights are from.
    given : (M, 3) float array
        Positions in the file [file units]; NaN where it does not say them.
    part : (M,) int array
        Which polyline each vertex belongs to: 0, 1, ...
    line : (P,) int array
        Of which of the lines that were given each polyline is a part.
    """

    xy: FloatArray
    z: FloatArray
    source: IntArray
    given: FloatArray
    part: IntArray
    line: IntArray

    @property
    def pieces(self) -> IntArray:
        """The vertices from which a piece leads to the next one, ascending."""
        return np.flatnonzero(self.part[1:] == self.part[:-1])

    @property
    def ends(self) -> FloatArray:
        """The ends (S, 4) of the pieces."""
        at = self.pieces
        return np.column_stack([self.xy[at], self.xy[at + 1]])

    def of_lines(self, vertices: IntArray) -> IntArray:
        """Return of which given lines vertices are."""
        return self.line[self.part[vertices]]

    def taken(self, chosen: BoolArray) -> Polylines:
        """Return the polylines without the vertices that are not chosen; those of fewer than two are left out."""
        part = self.part[chosen]
        counts = np.bincount(part, minlength=len(self.line))
        long = counts >= 2
        at = np.flatnonzero(chosen)[long[part]]
        number = np.cumsum(long) - 1
        return Polylines(
            self.xy[at], self.z[at], self.source[at], self.given[at], number[self.part[at]], self.line[long]
        )

    def between(self, piece: IntArray, t: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return place, height and source of points on the pieces from these vertices on: at 0 and 1 the ends."""
        share = t[:, None]
        inner = (t > 0.0) & (t < 1.0)
        near = piece + (t >= 1.0)
        xy = np.where(
            inner[:, None], rounded((1.0 - share) * self.xy[piece] + share * self.xy[piece + 1]), self.xy[near]
        )
        z = np.where(inner, (1.0 - t) * self.z[piece] + t * self.z[piece + 1], self.z[near])
        # the ends of a piece of a line are all given or none
        source = np.where(inner, np.where(self.source[piece] <= BETWEEN_GIVEN, BETWEEN_GIVEN, BETWEEN_DRAPED), 0)
        return xy, z, np.where(inner, source, self.source[near])

    def shares_of(self, piece: IntArray, xy: FloatArray) -> FloatArray:
        """Return where on the pieces from these vertices on places (n, 2) lie: at 0 and 1 at the ends."""
        u = self.xy[piece + 1] - self.xy[piece]
        return np.asarray(((xy - self.xy[piece]) * u).sum(axis=1) / (u**2).sum(axis=1))

    def with_vertices(self, piece: IntArray, t: FloatArray, xy: FloatArray, z: FloatArray) -> Polylines:
        """Return the polylines with more vertices in the pieces from these on, at 0 < t < 1."""
        _, _, source = self.between(piece, t)
        n = len(self.xy)
        order = np.lexsort((np.concatenate([np.zeros(n), t]), np.concatenate([np.arange(n), piece])))
        return Polylines(
            np.concatenate([self.xy, xy])[order],
            np.concatenate([self.z, z])[order],
            np.concatenate([self.source, source])[order],
            np.concatenate([self.given, np.full((len(piece), 3), np.nan)])[order],
            np.concatenate([self.part, self.part[piece]])[order],
            self.line,
        )


def lined_model(model: OpenModel, break_lines: Any, tolerance: float | None) -> OpenModel:
    """Return the model with break lines: their vertices among its own, and what every mesh must hold.

    Vertices of lines that are none of the model's are added, with weight 0, and without faces: the original surface
    stays as it is. Where a line with heights of its own passes through the place of a vertex of another height, it has
    a vertex of its own there, which carries the surface.

    Parameters
    ----------
    model : OpenModel
        The model of N vertices.
    break_lines : path, str, SourceLines, or list of (n, 2) or (n, 3) arrays
        Lines in the frame of the model's file, or ``"outline"`` or ``"sharp:DEGREES"``; see `Rules`.
    tolerance : float, optional
        How far a vertex of a line may be from what is left of it, in space [model units]. None, for words alone:
        1e-3 of the diagonal.

    Raises
    ------
    InputError
        If the tolerance is missing or no number of at least 0.
    ModelError
        If the lines cannot be read or used, none of them lies in the model, or two of them cross.

    Warns
    -----
    ModelWarning
        If parts of lines lie outside the model, repeat themselves, or have several heights at one place.

    Examples
    --------
    The ridge of a roof, whose 17 vertices are on one straight line:

    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.model import build_model
    >>> roof = lined_model(build_model(load("roof")), [[[0, -1, 1], [0, 0, 1], [0, 1, 1]]], 0.01)
    >>> roof.points[roof.lines.chains[0]].tolist(), len(roof.lines.added)
    ([[1.0, 0.0, 1.0], [1.0, 2.0, 1.0]], 0)
    """
    lining = _Lining(model, tolerance_of(model, break_lines, tolerance))
    return lining.of_word(break_lines) if is_word_for_lines(break_lines) else lining.of_lines(break_lines)


def tolerance_of(model: Mesh, break_lines: Any, tolerance: float | None) -> float:
    """Return how far lines may move: what is said, else what is usual for lines that a word names.

    Raises
    ------
    InputError
        If it is missing or no number of at least 0.
    """
    if tolerance is None and is_word_for_lines(break_lines):
        tolerance = USUAL_TOLERANCE * model.diagonal
    if tolerance is None or not 0.0 <= tolerance < np.inf:
        raise InputError(f"line_tolerance is {tolerance}; give how far break lines may move in space, 0 or more")
    return float(tolerance)


class _Lining:
    """One model's lining; ``found`` counts what is said in the end."""

    def __init__(self, model: OpenModel, tolerance: float) -> None:
        self.model = model
        self.tolerance = tolerance
        self.reach = SNAP * float(np.hypot(*np.ptp(model.xy, axis=0)))
        self.height_reach = SNAP * model.diagonal
        self.height_tolerance = max(tolerance, self.height_reach)
        self.first = np.unique(highest(model.xy))  # the vertices that carry the surface, one a place
        self.places = cKDTree(model.xy[self.first])
        self.found: dict[str, int] = {}
        self.what = ""
        self.names: tuple[str, ...] = ()
        self.turned = np.zeros(0, bool)
        self.way_out = "give the crossing as a vertex of both, at one height, or leave one of them out"

    # ------------------------------------------------------------------------------------------------ the two ways in

    def of_word(self, word: str) -> OpenModel:
        rows = lines_of_word(self.model, word)
        self.what, self.names = f"break_lines={word!r}", tuple(f"line {k + 1}" for k in range(len(rows)))
        at = np.concatenate(rows)
        part = np.repeat(np.arange(len(rows)), [len(line) for line in rows])
        self.turned = np.zeros(len(rows), bool)
        self.found |= {"lines": len(rows), "line_vertices": len(at)}
        given = np.full((len(at), 3), np.nan)
        source = np.full(len(at), GIVEN)
        lines = Polylines(self.model.xy[at], self.model.points[at, 2], source, given, part, np.arange(len(rows)))
        self.way_out = "mend the outline, or give lines" if word == OUTLINE else "give a larger angle, or lines"
        return self._lined(self._met(lines))

    def of_lines(self, break_lines: Any) -> OpenModel:
        lines = self._read(break_lines)
        lines = self._distinct(self._snapped(lines), first=True)
        lines = self._distinct(self._snapped(self._cut(lines)))
        return self._lined(self._draped(self._met(self._over_samples(lines))))

    def _read(self, break_lines: Any) -> Polylines:
        """Bring lines into the model's frame."""
        model = self.model
        source = lines_in_file_frame(model, break_lines)
        self.what, self.names = source.name, source.names
        n_soft = sum(line.shape[1] == 2 for line in source.lines)
        if n_soft and not (model.rotation[2] == (0.0, 0.0, 1.0)).all():
            raise ModelError(
                f"{source.name}: {n_soft} of {len(source.lines)} lines have no heights, and the heights of "
                f"{model.name} are along {model.up.round(6).tolist()}, not along the file's z; give x, y and z of each "
                "vertex"
            )
        # all are gone along in the one direction that does not depend on how they are listed
        self.turned = np.array([_is_turned(line) for line in source.lines])
        along = [line[::-1] if turned else line for line, turned in zip(source.lines, self.turned, strict=True)]
        lengths = [len(line) for line in along]
        part = np.repeat(np.arange(len(lengths)), lengths)
        hard = np.array([line.shape[1] == 3 for line in along])[part]
        given = np.full((len(part), 3), np.nan)
        for end, line in zip(np.cumsum(lengths), along, strict=True):
            given[end - len(line) : end, : line.shape[1]] = line
        # what has no height is seen from above, whatever height it is given
        local = model.to_local(np.where(np.isnan(given), 0.0, given))
        self.found |= {"lines": len(lengths), "line_vertices": len(part)}
        return Polylines(
            rounded(local[:, :2] / model.unit),
            np.where(hard, local[:, 2], np.nan),
            np.where(hard, GIVEN, DRAPED),
            given,
            part,
            np.arange(len(lengths)),
        )

    # ------------------------------------------------------------------------------------------------------ the places

    def _snapped(self, lines: Polylines) -> Polylines:
        """Put vertices at the places of the model's vertices, or of each other, that are as near as makes no matter."""
        xy = lines.xy.copy()
        away, place = self.places.query(xy, distance_upper_bound=self.reach)
        near = np.isfinite(away)
        xy[near] = self.places.data[place[near]]
        others = np.flatnonzero(~near)
        places, number = _distinct_places(xy[others])
        xy[others] = places[first_near(places, self.reach)[number]]
        moved = (xy != lines.xy).any(axis=1)
        given = np.where(moved[:, None], np.nan, lines.given)
        return dataclasses.replace(lines, xy=xy, given=given)

    def _distinct(self, lines: Polylines, first: bool = False) -> Polylines:
        """Leave out vertices at the place of the one before, and lines of one place; count them, the first time."""
        same = np.zeros(len(lines.xy), bool)
        same[1:] = (lines.part[1:] == lines.part[:-1]) & (lines.xy[1:] == lines.xy[:-1]).all(axis=1)
        rest = lines.taken(~same)
        if first:
            n_lines = len(lines.line) - len(rest.line)
            steps = np.abs(np.diff(lines.z, prepend=0.0))[same]
            self.found |= {
                "repeated_vertices": int(same.sum()),
                "lines_of_one_place": n_lines,
                "heights_left_out": int((steps > self.height_reach).sum()),
            }
            said = [f"{same.sum()} vertices repeat the place of the one before"] if same.any() else []
            said += [f"{n_lines} lines are one place"] if n_lines else []
            if said:
                warn_of(f"{self.what}: {', and '.join(said)}; they are left out")
        return rest

    # --------------------------------------------------------------------------------------------------- the footprint

    def _cut(self, lines: Polylines) -> Polylines:
        """Cut off what lies outside the projection of the original faces."""
        model = self.model
        if len(lines.line) == 0:
            raise ModelError(f"{self.what}: holds no line of two places; give one or more")
        segment, at, height, goes_on = along_faces(lines.ends, model.xy, model.points[:, 2], model.faces, self.reach)
        self._compare_heights(lines, lines.pieces[segment], at, height)
        before = np.zeros(len(at), bool)
        before[1:] = goes_on[:-1] & (segment[1:] == segment[:-1])
        low, high = np.flatnonzero(goes_on & ~before), np.flatnonzero(before & ~goes_on)
        pieces = lines.pieces
        piece, start, end = pieces[segment[low]], at[low], at[high]
        length = np.hypot(*(lines.ends[:, 2:] - lines.ends[:, :2]).T)
        inside = float(((end - start) * length[segment[low]]).sum())
        n_lines = len(self.names)
        held, whole = np.zeros(n_lines, bool), np.ones(n_lines, bool)
        held[lines.of_lines(piece)] = True
        is_whole = np.zeros(len(pieces), bool)
        is_whole[segment[low][(start == 0.0) & (end == 1.0)]] = True
        whole[lines.of_lines(pieces[~is_whole])] = False
        given = np.zeros(n_lines, bool)
        given[lines.line] = True
        n_left_out, n_cut = int((given & ~held).sum()), int((held & ~whole).sum())
        if not held.any():
            raise ModelError(self._nothing_inside(lines))
        if n_left_out or n_cut:
            self.found |= {"lines_cut": n_cut, "lines_left_out": n_left_out}
            share = 1.0 - inside / float(length.sum())
            warn_of(
                f"{self.what}: of {n_lines} lines, parts of {n_cut} and the whole of {n_left_out} lie outside "
                f"{model.name} and are cut off: {share:.2%} of the length"
            )
        # what begins where the piece before it ends goes on
        joins = np.zeros(len(piece), bool)
        joins[1:] = (start[1:] == 0.0) & (end[:-1] == 1.0) & (piece[1:] == piece[:-1] + 1)
        begins = np.flatnonzero(~joins)
        part = np.cumsum(~joins) - 1
        order = np.argsort(np.concatenate([2 * begins, 2 * np.arange(len(piece)) + 1]), kind="stable")
        of = np.concatenate([piece[begins], piece])[order]
        t = np.concatenate([start[begins], end])[order]
        xy, z, source = lines.between(of, t)
        inner = ((t > 0.0) & (t < 1.0))[:, None]
        return Polylines(
            np.clip(xy, 0.0, model.xy.max(axis=0)),
            z,
            source,
            np.where(inner, np.nan, lines.given[of + (t >= 1.0)]),
            np.concatenate([part[begins], part])[order],
            lines.of_lines(piece[begins]),
        )

    def _compare_heights(self, lines: Polylines, piece: IntArray, at: FloatArray, surface: FloatArray) -> None:
        """Warn of lines with heights that are in another unit or datum, by the surface's where they go along it."""
        _, z, source = lines.between(piece, at)
        away = np.abs(z - surface)[source <= BETWEEN_GIVEN]
        relief = float(np.ptp(self.model.points[:, 2]))
        if relief and len(away) and away.mean() > SUSPECT_SHARE * relief:
            warn_of(
                f"{self.what}: lines with heights lie {away.mean():.4g} off the surface of {self.model.name} on "
                f"average, whose heights span {relief:.4g}; check the unit and datum of theirs, or give x and y alone"
            )

    def _nothing_inside(self, lines: Polylines) -> str:
        model = self.model
        at = self._in_file(np.column_stack([lines.xy * model.unit, np.nan_to_num(lines.z)]))
        return (
            f"{self.what}: none of the {len(self.names)} lines lies in {model.name}: they span "
            f"{box_in_words('xy', np.array([at.min(axis=0), at.max(axis=0)]))}, the model "
            f"{box_in_words('xy', model.file_box)}; check that both have the same reference system and units"
        )

    def _in_file(self, points: FloatArray) -> FloatArray:
        """Return points of the model's frame in that of its file; the inverse of its ``to_local``."""
        model = self.model
        turned: FloatArray = ((points + model.offset) @ model.rotation + model.pivot) / model.scale
        return turned

    # ------------------------------------------------------------------------------------------------- where lines meet

    def _over_samples(self, lines: Polylines) -> Polylines:
        """Give lines with heights a vertex wherever they pass far above or below a vertex of the model."""
        places, node = _distinct_places(lines.xy)
        pieces = lines.pieces
        pieces = pieces[lines.source[pieces] <= BETWEEN_GIVEN]
        if len(pieces) == 0:
            return lines
        ends = len(self.first) + np.column_stack([node[pieces], node[pieces + 1]])
        vertex, number = points_on(np.concatenate([self.places.data, places]), ends, self.reach).T
        vertex, number = vertex[vertex < len(self.first)], number[vertex < len(self.first)]
        piece, xy = pieces[number], self.places.data[vertex]
        t = lines.shares_of(piece, xy)
        _, z, _ = lines.between(piece, t)
        far = np.abs(z - self.model.points[self.first[vertex], 2]) > self.height_tolerance
        return lines.with_vertices(piece[far], t[far], xy[far], z[far])

    def _met(self, lines: Polylines) -> Polylines:
        """Make vertices of one line on another vertices of both; refuse lines that cross otherwise."""
        places, node = _distinct_places(lines.xy)
        pieces, ends, number = _segments(lines, node)
        on = points_on(places, ends, self.reach)
        if len(on):
            # all pieces that are this segment
            order = np.argsort(number, kind="stable")
            first = np.searchsorted(number[order], np.arange(len(ends) + 1))
            counts = first[on[:, 1] + 1] - first[on[:, 1]]
            which = np.repeat(np.arange(len(on)), counts)
            within = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
            piece = pieces[order[first[on[which, 1]] + within]]
            xy = places[on[which, 0]]
            t = lines.shares_of(piece, xy)
            _, z, _ = lines.between(piece, t)
            lines = lines.with_vertices(piece, t, xy, z)
            pieces, ends, number = _segments(lines, np.searchsorted(place_keys(places), place_keys(lines.xy)))
        pairs = meeting_segments(places, ends)
        if len(pairs):
            lines_of = np.full(len(ends), -1)
            lines_of[number[::-1]] = lines.of_lines(pieces)[::-1]
            raise ModelError(self._crossing(places, ends[pairs], np.sort(lines_of[pairs], axis=1)))
        return lines

    def _crossing(self, places: FloatArray, ends: IntArray, lines: IntArray) -> str:
        """Say which lines (M, 2) cross in pairs of segments (M, 2, 2): the first two."""
        k = np.lexsort((lines[:, 1], lines[:, 0]))[0]
        first, second = (self.names[line] for line in lines[k])
        a, b, c, d = places[ends[k].ravel()]
        u, v = b - a, d - c
        turn = u[0] * v[1] - u[1] * v[0]
        t = ((c[0] - a[0]) * v[1] - (c[1] - a[1]) * v[0]) / turn if turn else 0.5
        x, y = self._in_file(np.array([[*((a + t * u) * self.model.unit), 0.0]]))[0, :2]
        what = f"{first} crosses itself" if lines[k, 0] == lines[k, 1] else f"{first} and {second} cross"
        more = f" (the first of {len(lines)} crossings)" if len(lines) > 1 else ""
        return f"{self.what}: {what} at {x:.9g}, {y:.9g}{more}; {self.way_out}"

    # ----------------------------------------------------------------------------------------------------- the heights

    def _draped(self, lines: Polylines) -> Polylines:
        """Give lines without heights those of the original faces, and a vertex wherever they cross an edge of them."""
        model = self.model
        is_soft = lines.source >= DRAPED
        if not is_soft.any():
            return lines
        pieces = lines.pieces
        soft = is_soft[pieces]
        pieces, ends = pieces[soft], lines.ends[soft]
        # ends of pieces may be off by the reach already
        segment, at, height, _ = along_faces(ends, model.xy, model.points[:, 2], model.faces, 2.0 * self.reach)
        piece, z = pieces[segment], lines.z.copy()
        for of_end, t in ((piece, 0.0), (piece + 1, 1.0)):
            z[of_end[at == t]] = height[at == t]
        lines = dataclasses.replace(lines, z=z)
        inner = (at > 0.0) & (at < 1.0)
        xy, _, _ = lines.between(piece[inner], at[inner])
        lines = self._distinct(self._snapped(lines.with_vertices(piece[inner], at[inner], xy, height[inner])))
        # at a vertex of the model its height is known better than any triangle says
        away, place = self.places.query(lines.xy, distance_upper_bound=self.reach)
        known = np.isfinite(away) & (lines.source >= DRAPED)
        z = lines.z.copy()
        z[known] = model.points[self.first[place[known]], 2]
        # these vertices are also of the lines with heights of their own that run along with them
        return self._met(dataclasses.replace(lines, z=z))

    # ------------------------------------------------------------------------------------------------------ the result

    def _lined(self, lines: Polylines) -> OpenModel:
        """Thin the lines, add their vertices to the model and put it in order."""
        model = self.model
        places, node = _distinct_places(lines.xy)
        z, chosen = self._heights(lines, node, len(places))
        away, place = self.places.query(places, distance_upper_bound=self.reach)
        # the model's vertex at each place, -1 where there is none
        at = np.where(np.isfinite(away), self.first[np.minimum(place, len(self.first) - 1)], -1)
        of_model = (at >= 0) & (
            (lines.source[chosen] >= DRAPED) | (np.abs(z - model.points[at, 2]) <= self.height_reach)
        )
        points = np.column_stack([places * model.unit, z])
        points[at >= 0, :2] = model.points[at[at >= 0], :2]
        points[of_model] = model.points[at[of_model]]

        cuts = np.flatnonzero(np.diff(lines.part)) + 1
        corners = np.flatnonzero(np.isin(at, highest(model.xy)[model.corners]))
        runs = cut_into_runs(np.split(node, cuts), corners)
        own = (at >= 0) & (np.abs(z - model.points[at, 2]) > self.height_tolerance) & ~of_model
        kept = self._thinned(runs, places, points, own)
        chains = runs.joined(kept)

        used = np.unique(np.concatenate(chains))
        new = used[~of_model[used]]
        file_points = self._in_file(points[new])
        given = lines.given[chosen[new]]
        file_points = np.where(np.isnan(given), file_points, given)
        lined, row_of_new, row = self._with_vertices(places[new], points[new], file_points)
        rows = np.full(len(places), -1)
        rows[of_model] = row[at[of_model]]
        rows[new] = row_of_new
        old_added = row[model.lines.added] if model.lines is not None else row_of_new[:0]
        originals = np.split(np.column_stack([lines.xy * model.unit, lines.z]), cuts)
        # as they are listed: the parts of a line that was turned the last first
        turned = self.turned[lines.line]
        parts = np.lexsort((np.where(turned, -1, 1) * np.arange(len(turned)), lines.line))
        ways = np.where(turned, -1, 1)
        self.found |= {"kept_line_vertices": len(used), "added_line_vertices": len(new)}
        return dataclasses.replace(
            lined,
            lines=ModelLines(
                originals=tuple(originals[k][:: ways[k]] for k in parts),
                chains=tuple(rows[chains[k]][:: ways[k]] for k in parts),
                names=tuple(self.names[lines.line[k]] for k in parts),
                tolerance=self.tolerance,
                added=np.sort(np.concatenate([old_added, row_of_new])),
                found={what: n for what, n in self.found.items() if n},
            ),
        )

    def _heights(self, lines: Polylines, node: IntArray, n: int) -> tuple[FloatArray, IntArray]:
        """Return the height of each of n places, and which vertex of the lines it is of: the first with its own."""
        order = np.lexsort((lines.source, node))
        first = np.searchsorted(node[order], np.arange(n))
        chosen = order[first]
        z = lines.z[chosen]
        differs = (lines.source <= BETWEEN_GIVEN) & (np.abs(lines.z - z[node]) > self.height_reach)
        n_differ = len(np.unique(node[differs]))
        if n_differ:
            self.found["places_of_several_heights"] = n_differ
            k = int(np.flatnonzero(differs)[0])
            x, y, _ = self._in_file(np.array([[*(lines.xy[k] * self.model.unit), lines.z[k]]]))[0]
            warn_of(
                f"{self.what}: lines have several heights at {n_differ} places (first: {x:.9g}, {y:.9g}, where they "
                f"differ by {abs(lines.z[k] - z[node[k]]):.6g}); the first given counts"
            )
        return z, chosen

    def _thinned(self, runs: Runs, places: FloatArray, points: FloatArray, own: BoolArray) -> list[IntArray]:
        """Return which vertices of each run stay: few, so that none cross or pass each other, or samples they are over.

        ``own`` says which places have a height so far from that of the model's vertex there that both cannot stand for
        each other.
        """

        def over(chords: Chords) -> set[tuple[int, int]]:
            back: set[tuple[int, int]] = set()
            for p, s in points_on(places, chords.ends, self.reach):
                between = chords.between(runs, s)[1:-1]
                back |= {(chords.run[s], chords.low[s] + 1 + at) for at in np.flatnonzero(between == p) if own[p]}
            return back

        tolerance = self.height_tolerance
        kept, self.found["put_back_line_vertices"] = thinned_runs(
            runs, places, points, tolerance, farthest_in=points, also=over if own.any() else None
        )
        return kept

    def _with_vertices(
        self, xy: FloatArray, points: FloatArray, file_points: FloatArray
    ) -> tuple[OpenModel, IntArray, IntArray]:
        """Return the model with A more vertices, their rows, and those of the N that it had."""
        model, n = self.model, self.model.n_vertices
        if len(xy) == 0:
            return model, np.empty(0, np.int64), np.arange(n)
        both = np.concatenate([model.xy, xy])
        # the highest of a place first, but before it a line's vertex
        order = vector_order(both, np.concatenate([-model.points[:, 2], np.full(len(xy), -np.inf)]))
        row = np.argsort(order)
        added = np.sort(row[n:])
        place = np.ascontiguousarray(both[order])
        last = int(max(model.source_index.max(), model.repeats.max(initial=0)))
        source_index = np.concatenate([model.source_index, np.empty(len(xy), model.source_index.dtype)])[order]
        source_index[added] = last + 1 + np.arange(len(added))
        _, nearest = cKDTree(model.xy).query(xy)
        weights = np.ones(n) if model.weights is None else model.weights
        lined = dataclasses.replace(
            model,
            points=np.ascontiguousarray(np.concatenate([model.points, points])[order]),
            faces=row[model.faces].astype(model.faces.dtype),
            corners=np.unique(highest(place)[row[model.corners]]),
            source_index=source_index,
            file_points=np.concatenate([model.file_points, file_points])[order],
            attributes={
                name: np.concatenate([values, values[nearest]])[order] for name, values in model.attributes.items()
            },
            xy=place,
            weights=np.concatenate([weights, np.zeros(len(xy))])[order],
            feet=np.sort(row[model.feet]),
        )
        return lined, row[n:], row[:n]


def _is_turned(line: FloatArray) -> bool:
    """Tell whether a line (n, 2 or 3) leads from its greater end to the lesser, or if closed, first to the greater."""
    ends = [(tuple(line[k]), tuple(line[step])) for k, step in ((0, 1), (-1, -2))]
    return ends[1] < ends[0]


def rounded(xy: FloatArray) -> FloatArray:
    """Round to multiples of 2**-52, as the model's places are."""
    return (xy + 1.0) - 1.0


def place_keys(xy: FloatArray) -> Any:
    """Return one number a place, ascending by x, then y."""
    return np.ascontiguousarray(xy + 0.0)[:, 0] + 1j * xy[:, 1]


def _distinct_places(xy: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the different places (P, 2), by x, then y, and which of them each (M, 2) is."""
    found, number = np.unique(place_keys(xy), return_inverse=True)
    return np.column_stack([found.real, found.imag]), number.ravel()


def first_near(places: FloatArray, reach: float) -> IntArray:
    """Return for each place (P, D) the first of those that lead to it in steps of at most ``reach``: (P,) rows.

    Where places ascend, the order of the lines that they are of is no matter.
    """
    pairs = cKDTree(places).query_pairs(reach, output_type="ndarray") if len(places) > 1 else np.empty((0, 2), int)
    if len(pairs) == 0:
        return np.arange(len(places))
    links = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(places),) * 2)
    group = connected_components(links, directed=False)[1]
    return np.asarray(np.unique(group, return_index=True)[1][group])


def box_in_words(axes: str, box: FloatArray) -> str:
    """Return from where to where a box (2, 3), its lowest and highest corner, reaches along some of the axes."""
    return ", ".join(
        f"{axis} {low:.9g} to {high:.9g}" for axis, low, high in zip(axes, *box[:, : len(axes)], strict=True)
    )


def _segments(lines: Polylines, node: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the pieces, the different segments (S, 2) between places that they are, and which of these each is."""
    pieces = lines.pieces
    ends = np.sort(np.column_stack([node[pieces], node[pieces + 1]]), axis=1)
    different, number = np.unique(ends, axis=0, return_inverse=True)
    return pieces, different, number.ravel()
