"""How lines become break lines of a closed surface: found in it or traced on it, thinned once, their edges forced.

In this order:

1. Words name chains of the original's own edges. Other lines are brought into the model's frame; what is within `SNAP`
   of a vertex of the model, or of another vertex of a line, is at its place, and lines that pass so near by have it.
2. Between their vertices lines follow the surface (`tracing`). What is too far from it, or over a hole, is cut off.
   Where a line passes the pole of its part, which has no inside in the plane, it goes through a corner of it.
3. Lines that cross between vertices are refused.
4. What is between the places where lines meet or end is thinned in space. Vertices are put back where chords come to
   cross in the plane, and where a vertex of the original would be on the wrong side of one: a straight edge in space is
   a curve in the plane, whose chord would have cut it off from the face that it lies in.
5. The vertices left that are none of the model's are added, without faces, and all are put in vector order again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from meshsimp_pymoo.arrays import BoolArray, FloatArray, IntArray
from meshsimp_pymoo.errors import ModelError, warn_of
from meshsimp_pymoo.plane.segments import enclosed_points, meeting_segments, points_on
from meshsimp_pymoo.surface.closed.model import ClosedModel, count, vector_order
from meshsimp_pymoo.surface.closed.nearest import distances_to_line
from meshsimp_pymoo.surface.closed.tracing import Traced, Tracer, near_in_space
from meshsimp_pymoo.surface.given_lines import lines_in_file_frame, lines_of_word
from meshsimp_pymoo.surface.line_thinning import Chords, thinned_runs
from meshsimp_pymoo.surface.lines import ModelLines
from meshsimp_pymoo.surface.lining import SNAP, box_in_words, first_near, place_keys, tolerance_of
from meshsimp_pymoo.surface.polylines import Runs, cut_into_runs, farthest_between
from meshsimp_pymoo.surface.rules import is_word_for_lines

# An image so near to a chord may be on it: a few times what images are rounded to.
ON = 2.0**-50
# How far from the surface a vertex of a line may be, as a share of the diagonal, if the tolerance is no more.
REACH = 0.01


def lined_closed_model(model: ClosedModel, break_lines: Any, tolerance: float | None) -> ClosedModel:
    """Return the model with break lines: their vertices among its own, and what every mesh must hold.

    Vertices of lines that are none of the model's are added, with weight 0, and without faces: the original surface
    stays as it is.

    Parameters
    ----------
    model : ClosedModel
        The model of N vertices, without lines.
    break_lines : path, str, SourceLines, or list of (n, 3) arrays
        Lines in the frame of the model's file, or ``"outline"`` for the rims of holes or ``"sharp:DEGREES"``; see
        `Rules`.
    tolerance : float, optional
        How far a vertex of a line may be from what is left of it, in space [model units]. None, for words alone:
        1e-3 of the diagonal.

    Raises
    ------
    InputError
        If the tolerance is missing or no number of at least 0.
    ModelError
        If the lines cannot be read or used, have no z, none of them lies on the model, or two of them cross.

    Warns
    -----
    ModelWarning
        If parts of lines are not on the surface, or vertices repeat themselves, or are moved.

    Examples
    --------
    The edges of a cube, which are straight in space and curved in the plane:

    >>> from meshsimp_pymoo.datasets import load
    >>> from meshsimp_pymoo.surface.closed.model import closed_model
    >>> cube = lined_closed_model(closed_model(load("cube:5")), "sharp:30", None)
    >>> len(cube.lines.originals), len(cube.lines.added)
    (12, 0)
    """
    found = tolerance_of(model, break_lines, tolerance)
    lining = _Lining(model, found)
    return lining.of_word(break_lines) if is_word_for_lines(break_lines) else lining.of_lines(break_lines)


class _Lining:
    """One model's lining; ``found`` counts what is said in the end."""

    def __init__(self, model: ClosedModel, tolerance: float) -> None:
        self.model = model
        self.tolerance = tolerance
        self.reach = SNAP * model.diagonal
        self.found: dict[str, int] = {}
        self.what = ""
        self.names: tuple[str, ...] = ()
        # all that lines may have vertices at: first those of the model, then those of lines alone
        self.places, self.points = model.xy, model.points
        self.file_points = model.file_points

    # ------------------------------------------------------------------------------------------------ the two ways in

    def of_word(self, word: str) -> ClosedModel:
        lines = lines_of_word(self.model, word)
        self.what, self.names = f"break_lines={word!r}", tuple(f"line {k + 1}" for k in range(len(lines)))
        self.found |= {"lines": len(lines), "line_vertices": sum(map(len, lines))}
        return self._lined(lines, [self.points[line] for line in lines], np.arange(len(lines)))

    def of_lines(self, break_lines: Any) -> ClosedModel:
        given, line = self._read(break_lines)
        points = self._snapped(self.model.to_local(given))
        lines = self._distinct(points, line)
        found, originals, of = self._traced(points, given, lines)
        self._refuse_crossing(found, of)
        return self._lined(found, originals, of)

    def _read(self, break_lines: Any) -> tuple[FloatArray, IntArray]:
        """Return the vertices (M, 3) of lines [file units], and which line each is of."""
        source = lines_in_file_frame(self.model, break_lines)
        n_flat = sum(line.shape[1] == 2 for line in source.lines)
        if n_flat:
            raise ModelError(
                f"{source.name}: {count(n_flat, 'line has', 'lines have')} x and y only, and {self.model.name} "
                "is a closed surface, where these are no place; give x, y and z of each vertex"
            )
        self.what, self.names = source.name, source.names
        lengths = [len(line) for line in source.lines]
        self.found |= {"lines": len(lengths), "line_vertices": sum(lengths)}
        return np.concatenate(source.lines), np.repeat(np.arange(len(lengths)), lengths)

    # ------------------------------------------------------------------------------------------------------ the places

    def _snapped(self, points: FloatArray) -> FloatArray:
        """Put vertices at the places of the model's vertices, or of each other, that are as near as makes no matter."""
        order = np.lexsort(points.T[::-1])
        found = points.copy()
        found[order] = points[order][first_near(points[order], self.reach)]
        away, row = cKDTree(self.model.points).query(points, distance_upper_bound=self.reach)
        near = np.isfinite(away)
        found[near] = self.model.points[row[near]]
        return found

    def _distinct(self, points: FloatArray, line: IntArray) -> list[IntArray]:
        """Return the vertices of each line, without those at the place of the one before; count these."""
        same = np.zeros(len(line), bool)
        same[1:] = (line[1:] == line[:-1]) & (points[1:] == points[:-1]).all(axis=1)
        left = np.bincount(line[~same], minlength=len(self.names))
        if (left < 2).all():
            raise ModelError(f"{self.what}: holds no line of two places; give one or more")
        n_places = int((left < 2).sum())
        self.found |= {"repeated_vertices": int(same.sum()), "lines_of_one_place": n_places}
        said = [f"{count(int(same.sum()), 'vertex repeats', 'vertices repeat')} the one before"] if same.any() else []
        said += [f"{count(n_places, 'line is', 'lines are')} one place"] if n_places else []
        if said:
            warn_of(f"{self.what}: {', and '.join(said)}; they are left out")
        rows = np.split(np.flatnonzero(~same), np.cumsum(left)[:-1])
        return [row if len(row) > 1 else row[:0] for row in rows]

    def _traced(
        self, points: FloatArray, given: FloatArray, lines: list[IntArray]
    ) -> tuple[list[IntArray], list[FloatArray], IntArray]:
        """Return lines along the surface: as vertices, the model's and new ones, and as points; and which each is of.

        ``points`` and ``given`` (M, 3) are their vertices in the frames of the model and the file.
        """
        model = self.model
        # the different places: those of the model's vertices that lines pass, and their own
        both = np.concatenate([points, model.points])
        _, first, number = np.unique(both, axis=0, return_index=True, return_inverse=True)
        number = number.ravel()
        ends = both[first]
        file_ends = np.concatenate([given, model.file_points])[first]
        row = np.full(len(ends), -1)
        row[number[len(points) :]] = np.arange(model.n_vertices)
        nodes: list[IntArray] = [number[line] for line in lines]
        pieces = _pieces(nodes)
        at, piece, t = near_in_space(ends, pieces, self.reach)
        order = np.lexsort((t, piece))
        passed = np.split(at[order], np.searchsorted(piece[order], np.arange(1, len(pieces))))
        nodes = [_through(line, pieces, passed) for line in nodes]
        pieces = _pieces(nodes)
        used, local = np.unique(pieces, return_inverse=True)
        local = local.reshape(-1, 2)
        tracer = Tracer(model, self.tolerance, max(self.tolerance, REACH * model.diagonal))
        traced = tracer.traced(ends[used], local)
        # of each traced point: the model's vertex that it is, or a new one
        own = np.full(len(traced.points), -1)
        own[: len(used)] = row[used]
        taken = (traced.pole >= 0) & (own < 0)
        self.found["vertices_at_the_pole"] = int(taken.sum())
        own = np.where(taken, traced.pole, own)
        in_file = model.to_file(traced.points)
        in_file[: len(used)] = file_ends[used]
        new = np.flatnonzero((own < 0) & traced.is_passed)
        middle = model.xy[tracer.faces[traced.face[new]]].mean(axis=1)
        place = own.copy()
        place[new] = self._with_places(traced.points[new], traced.xy[new], in_file[new], middle)
        found: list[IntArray] = []
        originals: list[FloatArray] = []
        of: list[int] = []
        cut, kept, whole, aside = np.zeros(len(nodes), bool), 0.0, 0.0, 0.0
        for k, line in enumerate(nodes):
            part, joined = _along(np.searchsorted(used, line), local, traced)
            length = np.linalg.norm(np.diff(traced.points[part], axis=0), axis=1)
            whole += float(length.sum())
            kept += float(length[joined].sum())
            cut[k] = not joined.all()
            for some in np.split(part, np.flatnonzero(~joined) + 1):
                vertices = place[some][np.append(True, np.diff(place[some]) != 0)]
                if len(vertices) > 1:
                    found.append(vertices)
                    originals.append(traced.points[some])
                    of.append(k)
                    aside = max([aside, *distances_to_line(traced.points[some[taken[some]]], self.points[vertices])[0]])
        on = np.isin(np.arange(len(nodes)), of)
        self._say_cut(points, on, on & cut, ~on & np.array([len(line) > 0 for line in nodes]), 1.0 - kept / whole)
        if aside > self.tolerance:
            warn_of(
                f"{self.what}: lines pass a face of {model.name} that is the outside of the plane, and go through its "
                f"corners there, up to {aside:.4g} aside"
            )
        return found, originals, np.array(of)

    def _with_places(
        self, points: FloatArray, images: FloatArray, file_points: FloatArray, middle: FloatArray
    ) -> IntArray:
        """Return as which new vertices points count, whose images are those of none of the model's.

        Where these would coincide, they are moved towards the middle (n, 2) of the face, by as little as there is.
        """
        model = self.model
        n = model.n_vertices
        taken = np.sort(place_keys(model.xy))
        step = 1.0
        while True:
            keys = place_keys(images)
            clash = taken[np.minimum(np.searchsorted(taken, keys), n - 1)] == keys
            if not clash.any():
                break
            images[clash] += step * 2.0**-52 * np.sign(middle - images)[clash]
            step += 1.0
        _, first, number = np.unique(keys, return_index=True, return_inverse=True)
        number = number.ravel()
        self.places = np.concatenate([model.xy, images[first]])
        self.points = np.concatenate([model.points, points[first]])
        self.file_points = np.concatenate([model.file_points, file_points[first]])
        away = np.linalg.norm(points - self.points[n + number], axis=1)
        n_merged = int((away > max(self.tolerance, self.reach)).sum())
        if n_merged:
            self.found["places_of_several_points"] = n_merged
            warn_of(
                f"{self.what}: {count(n_merged, 'point')} of lines lie above others, up to {away.max():.4g} from them; "
                "the first of a place counts"
            )
        return np.asarray(n + number)

    def _say_cut(self, points: FloatArray, on: BoolArray, cut: BoolArray, left_out: BoolArray, share: float) -> None:
        """Warn of what is not on the surface; refuse lines of which nothing is."""
        model, n_lines = self.model, count(len(on), "line")
        if not on.any():
            box = np.sort(model.to_file(np.array([points.min(axis=0), points.max(axis=0)])), axis=0)
            raise ModelError(
                f"{self.what}: none of {n_lines} lies on {model.name}: they span {box_in_words('xyz', box)}, the model "
                f"{box_in_words('xyz', model.file_box)}; check that both have the same units and origin"
            )
        if cut.any() or left_out.any():
            self.found |= {"lines_cut": int(cut.sum()), "lines_left_out": int(left_out.sum())}
            warn_of(
                f"{self.what}: of {n_lines}, parts of {cut.sum()} and the whole of {left_out.sum()} are farther than "
                f"{max(self.tolerance, REACH * model.diagonal):.4g} from {model.name}, or over its holes, and are cut "
                f"off: {share:.2%} of the length"
            )

    # ------------------------------------------------------------------------------------------------------ the result

    def _refuse_crossing(self, lines: list[IntArray], of: IntArray) -> None:
        """Refuse lines that have more in common than vertices."""
        line = np.repeat(of, [len(vertices) - 1 for vertices in lines])
        steps = np.sort(np.concatenate([np.column_stack([one[:-1], one[1:]]) for one in lines]), axis=1)
        ends, first = np.unique(steps, axis=0, return_index=True)
        pairs = meeting_segments(self.places, ends)
        if len(pairs) == 0:
            return
        which = np.sort(line[first[pairs]], axis=1)
        k = np.lexsort((which[:, 1], which[:, 0]))[0]
        one, other = (self.names[row] for row in which[k])
        at = self.model.to_file(_crossing(self.places[ends[pairs[k]]], self.points[ends[pairs[k, 0]]])[None])[0]
        what = f"{one} crosses itself" if one == other else f"{one} and {other} cross"
        more = f" (the first of {len(pairs)} crossings)" if len(pairs) > 1 else ""
        raise ModelError(
            f"{self.what}: {what} at {', '.join(f'{x:.9g}' for x in at)}{more}; give the crossing as a vertex of both, "
            "or leave one of them out"
        )

    def _lined(self, lines: list[IntArray], originals: list[FloatArray], of: IntArray) -> ClosedModel:
        """Thin lines of vertices, add those of them that are none of the model's and put it in order."""
        model = self.model
        runs = cut_into_runs(lines, model.poles.ravel())
        kept, n_back = thinned_runs(
            runs,
            self.places,
            self.points,
            max(self.tolerance, self.reach),
            farthest_in=self.places,
            also=lambda chords: self._astray(runs, chords),
        )
        chains = runs.joined(kept)
        used = np.unique(np.concatenate(chains))
        new = used[used >= model.n_vertices]
        lined, row = self._with_vertices(new)
        self.found |= {
            "put_back_line_vertices": n_back,
            "kept_line_vertices": len(used),
            "added_line_vertices": len(new),
        }
        made = ModelLines(
            originals=tuple(originals),
            chains=tuple(row[chain] for chain in chains),
            names=tuple(self.names[k] for k in of),
            tolerance=self.tolerance,
            added=np.sort(row[new]),
            found={what: n for what, n in self.found.items() if n},
        )
        return replace(lined, lines=made)

    def _astray(self, runs: Runs, chords: Chords) -> set[tuple[int, int]]:
        """Return what is put back so that no vertex of the model is on the wrong side of a chord, or on one."""
        longer = np.flatnonzero(chords.high - chords.low > 1)
        rings = [chords.between(runs, s) for s in longer.tolist()]
        if not rings:
            return set()
        wrong = set(enclosed_points(self.places, np.arange(self.model.n_vertices), rings)[:, 1].tolist())
        on = points_on(self.places, chords.ends[longer], ON)
        wrong |= {k for p, k in on.tolist() if p not in rings[k]}
        return {
            (int(chords.run[s]), int(chords.low[s]) + farthest_between(self.places[ring], 0, len(ring) - 1)[0])
            for k, (s, ring) in enumerate(zip(longer, rings, strict=True))
            if k in wrong
        }

    def _with_vertices(self, new: IntArray) -> tuple[ClosedModel, IntArray]:
        """Return the model with some new vertices, and in which of its rows each vertex that lines may have is now."""
        model, n = self.model, self.model.n_vertices
        row = np.full(len(self.places), -1)
        if len(new) == 0:
            row[:n] = np.arange(n)
            return model, row
        all_of_them = np.concatenate([np.arange(n), new])
        xy = np.ascontiguousarray(self.places[all_of_them])
        order = vector_order(xy)
        row[all_of_them[order]] = np.arange(len(order))
        place = row[:n]
        added = np.sort(row[new])
        last = int(max(model.source_index.max(), model.repeats.max(initial=0)))
        source_index = np.concatenate([model.source_index, np.empty(len(new), model.source_index.dtype)])[order]
        source_index[added] = last + 1 + np.arange(len(new))
        _, nearest = cKDTree(model.points).query(self.points[new])
        weights = np.ones(n) if model.weights is None else model.weights
        lined = replace(
            model,
            points=self.points[all_of_them][order],
            faces=place[model.faces].astype(model.faces.dtype),
            xy=xy[order],
            poles=place[model.poles],
            source_index=source_index,
            file_points=self.file_points[all_of_them][order],
            attributes={
                name: np.concatenate([values, values[nearest]])[order] for name, values in model.attributes.items()
            },
            weights=np.concatenate([weights, np.zeros(len(new))])[order],
        )
        return lined, row


def _crossing(places: FloatArray, points: FloatArray) -> FloatArray:
    """Return where two segments with these places (2, 2, 2) cross, on the first, whose ends are these points (2, 3)."""
    (a, b), (c, d) = places
    u, v = b - a, d - c
    turn = u[0] * v[1] - u[1] * v[0]
    t = ((c[0] - a[0]) * v[1] - (c[1] - a[1]) * v[0]) / turn if turn else 0.5
    return np.asarray(points[0] + np.clip(t, 0.0, 1.0) * (points[1] - points[0]))


def _pieces(lines: list[IntArray]) -> IntArray:
    """Return the different pieces (S, 2) of polylines, the lesser end first, sorted."""
    steps = [np.column_stack([line[:-1], line[1:]]) for line in lines]
    return np.unique(np.sort(np.concatenate(steps), axis=1), axis=0)


def _numbers(line: IntArray, pieces: IntArray) -> tuple[IntArray, BoolArray]:
    """Return which pieces the steps of a polyline are, and whether they are gone along from the first end on."""
    low, high = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    n = int(pieces.max(initial=0)) + 1
    return np.searchsorted(pieces[:, 0] * n + pieces[:, 1], low * n + high), line[:-1] == low


def _through(line: IntArray, pieces: IntArray, passed: list[IntArray]) -> IntArray:
    """Return a polyline with what each of its pieces passes, in order from its first end, as vertices."""
    parts = [line[:1]]
    for k, ahead, end in zip(*_numbers(line, pieces), line[1:], strict=True):
        parts += [passed[k] if ahead else passed[k][::-1], np.array([end])]
    return np.concatenate(parts)


def _along(line: IntArray, pieces: IntArray, traced: Traced) -> tuple[IntArray, BoolArray]:
    """Return the points of a polyline along the surface, and whether it goes on from each to the next."""
    points, joined = [line[:1]], [np.empty(0, bool)]
    for k, ahead in zip(*_numbers(line, pieces), strict=True):
        step = 1 if ahead else -1
        points.append(traced.chains[k][::step][1:])
        joined.append(traced.joined[k][::step])
    return np.concatenate(points), np.concatenate(joined)
