"""Free triangulations: valid after whatever moves, their cost as from scratch, better than what they began with."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from counts import tried
from hypothesis import given
from hypothesis import strategies as st
from nasty import SOURCES, nasty_model
from samples import surface

from meshsimp_pymoo.datasets import load
from meshsimp_pymoo.errors import ModelError
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.search.free import _thin
from meshsimp_pymoo.surface.books import EMITTED, END, N_EMITTED
from meshsimp_pymoo.surface.evaluate import COVER_TOLERANCE, REACH
from meshsimp_pymoo.surface.free import LEAST_HEIGHT, FreeShares
from meshsimp_pymoo.surface.measures import REGIONS
from meshsimp_pymoo.surface.model import build_model
from meshsimp_pymoo.surface.rules import FOOTPRINTS, OUTSIDES

RULES = list(itertools.product(FOOTPRINTS, OUTSIDES))
MEASURES = ["error", "max_error", "rms_error"]
# Moves between two looks from scratch.
LOOK = 50


def turns(xy, triangles):
    """Twice the areas of triangles (M, 3) of places (V, 2); those that are nearly 0 have the exact sign."""
    a, b, c = (xy[triangles[:, k]] for k in range(3))
    areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    for t in np.flatnonzero(np.abs(areas) < 1e-15):
        (ax, ay), (bx, by), (cx, cy) = ([Fraction(x) for x in xy[v]] for v in triangles[t])
        areas[t] = float((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
    return areas


def cost_from_scratch(free):
    """Check all that must hold of a free triangulation, and add its cost up anew, slowly."""
    books, g, n = free.books, free.freedom.ground, len(free.freedom.ground.z)
    xy = g.xy.reshape(-1, 2)
    records = books.mesh[: int(books.tally[END])].reshape(-1, 8)
    real = (records[:, :3] <= 0x7FFFFFFF).all(axis=1)
    emitted = (books.kind[: len(records)] & EMITTED) != 0
    # All triangles, those outside of the mesh too, fill a square around everything, each once: nothing overlaps.
    triangles = records[real, :3].astype(int)
    areas = turns(xy, triangles)
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(8.0)
    edges = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    assert len(np.unique(edges, axis=0)) == len(edges)
    for t in np.flatnonzero(real):
        for k in range(3):
            s, e = divmod(int(records[t, 4 + k]), 8)
            if real[s]:
                assert records[s, 4 + e] == 8 * t + k
                assert records[s, e] == records[t, (k + 1) % 3]
                assert records[s, (e + 1) % 3] == records[t, k]
    faces = free.faces
    assert not (emitted & ~real).any()
    assert len(faces) == emitted.sum() == books.tally[N_EMITTED] == free.triangles
    # Each sample is in the list of the triangle that holds it, or is a site.
    site = books.site[:n] == 1
    times = np.zeros(n, int)
    for t in np.flatnonzero(real):
        i = int(books.head[t])
        while i >= 0:
            times[i] += 1
            assert books.place[i] == 8 * t
            i = int(books.following[i])
    assert (times == ~site).all()
    np.testing.assert_array_equal(books.used[:n][site], np.bincount(faces.ravel(), minlength=n)[site])
    where = books.place[:n].astype(int) >> 3
    covered = ~site & emitted[where]
    deviation = np.zeros(n)
    for i in np.flatnonzero(covered):
        a, b, c = records[where[i], :3].astype(int)
        area = turns(xy, np.array([[a, b, c]]))[0]
        wb, wc = turns(xy, np.array([[a, i, c], [a, b, i]])) / area
        assert min(wb, wc, 1 - wb - wc) >= -1e-9 - 1e-15 / area
        deviation[i] = abs((1 - wb - wc) * g.z[a] + wb * g.z[b] + wc * g.z[c] - g.z[i])
    # The others cost their distance to the nearest segment; the first one in the written mesh where several are near.
    bare = np.flatnonzero(~covered & ~(site & (books.used[:n] > 0)))
    np.testing.assert_array_equal(np.flatnonzero(books.bare[:n]), bare)
    sides = [(face[k], face[(k + 1) % 3], face[(k + 2) % 3]) for face in faces for k in range(3)]
    twins = {(v, u) for u, v, _ in sides}
    a, b, c = np.array([side for side in sides if side[:2] not in twins]).T
    along = xy[b] - xy[a]
    for i in bare:
        share = np.clip(((xy[i] - xy[a]) * along).sum(axis=1) / (along[:, 0] ** 2 + along[:, 1] ** 2), 0.0, 1.0)
        away = xy[a] + share[:, None] * along - xy[i]
        gaps = away[:, 0] ** 2 + away[:, 1] ** 2
        k = int(np.argmin(gaps))
        third = turns(xy, np.array([[a[k], b[k], c[k]]]))[0]
        wb, wc = turns(xy, np.array([[a[k], i, c[k]], [a[k], b[k], i]])) / third
        rise = (1.0 - share[k]) * g.z[a[k]] + share[k] * g.z[b[k]] - g.z[i]
        if gaps[k] <= REACH**2 and min(wb, wc, 1 - wb - wc) >= -COVER_TOLERANCE:
            deviation[i] = abs((1 - wb - wc) * g.z[a[k]] + wb * g.z[b[k]] + wc * g.z[c[k]] - g.z[i])
        elif g.nearest:
            deviation[i] = np.hypot(np.sqrt(gaps[k]) * g.unit, rise)
    return float((g.weight * (deviation * g.scale) ** g.power).sum())


def heights(model, faces):
    """Least height of each triangle, in the unit square and as a share of its longest edge."""
    xy = model.xy[faces]
    longest = np.sqrt(((xy - np.roll(xy, 1, axis=1)) ** 2).sum(axis=2).max(axis=1))
    return np.array([turns(model.xy, faces) / longest, turns(model.xy, faces) / longest**2]).T


def anneal_and_look(free, moves, rng, rounding, look=LOOK):
    """Make moves at temperatures of all sizes, and look in between."""
    state, triangles = np.array([rng.integers(1, 2**63)], np.uint64), free.triangles
    scale = free.cost
    for _ in range(moves // look):
        hot = 10.0 ** rng.uniform(-3, 0.5) * scale / max(free.movable, 1)
        free.anneal(look, state, hot=hot, cold=0.1 * hot, triangles=triangles)
        assert free.triangles <= triangles
        assert free.cost == pytest.approx(cost_from_scratch(free), rel=rounding, abs=rounding * scale)


@tried("moves", 100)
@pytest.mark.parametrize("name", sorted(SOURCES))
def test_whatever_moves_a_free_triangulation_is_valid_and_its_cost_as_from_scratch(name, moves):
    model = nasty_model(name)
    rounding = 1e-5 if name == "slivers" else 1e-9  # a height in a sliver is worth that many digits less
    for k, (footprint, outside) in enumerate(RULES):
        if moves == 100 and (k + sorted(SOURCES).index(name)) % 2:
            continue
        rng = np.random.default_rng(k)
        measure = MEASURES[(k + sorted(SOURCES).index(name)) % len(MEASURES)]
        rated = surface(model, footprint=footprint, outside=outside, measure=measure)
        kept = rated.pinned | (rng.random(model.n_vertices) < 0.7 * rng.random())
        ground = rated.free_ground(centroids=bool(rng.random() < 0.5))
        ratio = float(rng.choice([0.0, 0.01, 0.1]))
        with ground.triangulation(kept, min_height=ratio) as free:
            np.testing.assert_array_equal(free.faces, rated.simplify(kept).faces)
            before = {tuple(face) for face in free.faces.tolist()}
            assert free.cost == pytest.approx(cost_from_scratch(free), rel=rounding)
            if footprint == "hull":
                region = turns(model.xy, free.faces).sum()
            anneal_and_look(free, moves, rng, rounding)
            came = np.array([face for face in free.faces.tolist() if tuple(face) not in before], int).reshape(-1, 3)
            if len(came):
                assert (heights(model, came) >= np.array([LEAST_HEIGHT, ratio]) * (1 - 1e-9)).all()
            if footprint == "hull":
                assert turns(model.xy, free.faces).sum() == pytest.approx(region)
            assert free.books.site[: model.n_vertices][free.faces].all()


@pytest.mark.filterwarnings("ignore::meshsimp_pymoo.errors.ModelWarning")
@given(
    heights=st.lists(st.integers(-3, 3), min_size=36, max_size=36),
    kept=st.lists(st.booleans(), min_size=36, max_size=36),
    gaps=st.lists(st.integers(0, 35), max_size=6),
    seed=st.integers(1, 2**63 - 1),
)
def test_on_a_raster_of_ties_too(heights, kept, gaps, seed):
    z = np.array(heights, float)
    z[[gap for gap in gaps if gap not in (0, 5, 30, 35)]] = np.nan
    try:
        model = build_model(grid_source(z.reshape(6, 6)), up="z")
    except ModelError:  # nothing is left but what is no mesh
        return
    rated = surface(model)
    subset = rated.pinned | np.array(kept)[model.source_index]
    with rated.free_ground().triangulation(subset) as free:
        anneal_and_look(free, 120, np.random.default_rng(seed), 1e-9, look=40)


def test_four_points_of_a_saddle_have_the_better_diagonal():
    """Delaunay's diagonal of a square is a matter of ties; the other one may be the surface itself."""
    z = np.add.outer(np.arange(5.0), np.arange(5.0))
    z = np.abs(z - 4.0)  # a ridge along one diagonal
    for turned in (z, z[::-1]):
        model = build_model(grid_source(turned), up="z")
        rated = surface(model)
        with rated.free_ground(centroids=False).triangulation(rated.pinned) as free:
            free.anneal(200, np.array([1], np.uint64), hot=0.0, cold=0.0, triangles=2)
            assert free.triangles == 2
            assert free.cost == pytest.approx(0.0, abs=1e-12)


def test_a_vertex_moves_to_where_it_belongs():
    """A pyramid whose top is not the vertex that is kept."""
    y, x = np.mgrid[:7, :7].astype(float)
    z = 3.0 - np.maximum(np.abs(x - 3), np.abs(y - 3))
    model = build_model(grid_source(z), up="z")
    rated = surface(model)
    kept = rated.pinned.copy()
    kept[np.flatnonzero((model.points[:, :2] == [2, 3]).all(axis=1))] = True
    with rated.free_ground(centroids=False).triangulation(kept) as free:
        free.anneal(300, np.array([3], np.uint64), hot=0.0, cold=0.0, triangles=4)
        assert free.cost == pytest.approx(0.0, abs=1e-12)
        assert sorted(model.points[np.unique(free.faces), 2]) == [0, 0, 0, 0, 3]


def test_vertices_of_the_outline_slide_and_swap_along_the_border():
    """Vertices of the border that are badly chosen: what lies beyond the outline costs its distance."""
    rated = surface(build_model(load("horseshoe:200")))
    kept = rated.pinned.copy()
    kept[rated.border[::6]] = True
    for shares, at_least in ((FreeShares(0.0, 1.0), 0.9), (FreeShares(0.0, 0.0), 0.9), (FreeShares(), 0.8)):
        with rated.free_ground(centroids=False).triangulation(kept, min_height=0.0) as free:
            triangles, cost, uncovered = free.triangles, free.cost, np.count_nonzero(free.books.bare[: len(kept)])
            assert uncovered > 0
            state = np.array([1], np.uint64)
            for hot in (0.1, 0.03, 0.0):
                free.anneal(3000, state, hot=hot, cold=hot, triangles=triangles, shares=shares)
            assert free.triangles == triangles
            assert free.cost < at_least * cost
            assert free.cost == pytest.approx(cost_from_scratch(free))
            assert set(np.unique(free.faces)) - set(np.flatnonzero(kept))


@pytest.mark.parametrize("name", ["jacksboro:11", "face:300"])
def test_annealing_lowers_the_error_below_that_of_the_best_subset_known(name):
    rated = surface(build_model(load(name)))
    rng = np.random.default_rng(1)
    kept = rated.pinned | (rng.random(rated.n_vertices) < 0.15)
    found = {}
    for ratio, centroids in itertools.product((0.0, 0.1), (False, True)):
        with rated.free_ground(centroids=centroids).triangulation(kept, min_height=ratio) as free:
            triangles, cost = free.triangles, free.cost
            state = np.array([1], np.uint64)
            hot = 0.1 * cost / free.movable
            for k in range(20):
                free.anneal(2000, state, hot=hot * 0.8**k, cold=hot * 0.8 ** (k + 1), triangles=triangles)
            free.anneal(2000, state, hot=0.0, cold=0.0, triangles=triangles)
            assert free.triangles <= triangles
            assert (free.accepted > 0).all()
            found[ratio, centroids] = free.cost / cost
    assert max(found.values()) < 0.6
    assert found[0.0, False] < found[0.1, False]  # the limit costs something


def test_the_same_seed_makes_the_same_moves():
    rated = surface(build_model(load("face:300")))
    faces = []
    for _ in range(2):
        with rated.free_ground().triangulation(rated.selection(60)) as free:
            free.anneal(3000, np.array([5], np.uint64), hot=1.0, cold=0.1, triangles=free.triangles)
            faces.append(free.faces)
    np.testing.assert_array_equal(*faces)


@pytest.mark.parametrize("what", FreeShares._fields)
def test_each_kind_of_move_can_be_left_out(what):
    rated = surface(build_model(load("face:300")))
    shares = FreeShares(**{name: 0.5 * (name != what) for name in FreeShares._fields})
    with rated.free_ground().triangulation(rated.selection(60)) as free:
        free.anneal(4000, np.array([5], np.uint64), hot=1.0, cold=0.1, triangles=free.triangles, shares=shares)
        assert free.accepted[list(FreeShares._fields).index(what)] == 0
        assert free.accepted.sum() > 0


def thinned(ground, free, rated, least):
    """Thin a free triangulation; return the vertices that collapsed, and the error and the triangles after each."""
    n = rated.n_vertices
    removed, error, triangles = np.empty(n, np.int32), np.empty(n + 1), np.empty(n + 1, np.int32)
    sizes, table = np.array([free.triangles, least]), np.full((2, REGIONS + 1), np.nan)
    look = sizes, ground.share, np.zeros(1, np.bool_), removed, error, triangles, np.zeros(2, np.int64), table
    made, _ = _thin(free.freedom, free.books, n, rated.pinned, *look)
    return removed[:made], error[: made + 1], triangles[: made + 1]


@pytest.mark.parametrize("name", ["face:300", "horseshoe:200"])
def test_thinning_collapses_the_cheapest_vertex_and_says_onto_which(name):
    rated = surface(build_model(load(name)))
    n, model = rated.n_vertices, rated.model
    ground = rated.free_ground(centroids=False)
    with ground.triangulation(rated.selection(90)) as free:
        free.anneal(3000, np.array([7], np.uint64), hot=0.1, cold=0.01, triangles=free.triangles)
        first = free.faces
        removed, error, triangles = thinned(ground, free, rated, 12)
        made = len(removed)
        last, onto = free.faces, free.freedom.onto.copy()
        assert free.cost == pytest.approx(cost_from_scratch(free))
    assert made > 20
    to = np.arange(n)
    for k in range(made):
        to[to == removed[k]] = onto[removed[k]]
        faces = to[first]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        assert len(faces) == triangles[k + 1]
        assert rated.score(model.file_points, faces).quality.error == pytest.approx(error[k + 1])
    least = np.argmin(faces, axis=1)
    faces = np.take_along_axis(faces, (least[:, None] + np.arange(3)) % 3, axis=1)
    np.testing.assert_array_equal(faces[np.lexsort(faces.T[::-1])], last)


def test_the_cheapest_collapse_is_the_cheapest_of_all():
    rated = surface(build_model(load("face:200")))
    ground = rated.free_ground(centroids=False)
    with ground.triangulation(rated.selection(40)) as free:
        cost, first = free.cost, free.faces
        thinned(ground, free, rated, free.triangles - 1)
        found = free.cost - cost
    best = np.inf
    sides = {(int(f[k]), int(f[(k + 1) % 3])) for f in first for k in range(3)}
    outline = {v for u, v in sides if (v, u) not in sides}
    for u, v in sides | {(v, u) for u, v in sides}:
        if rated.pinned[u] or u in outline:
            continue
        faces = np.where(first == u, v, first)
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        if (heights(rated.model, faces[(faces == v).any(axis=1)])[:, 1] >= 0.1).all():
            best = min(best, rated.score(rated.model.file_points, faces).quality.error - cost)
    assert found <= best + 1e-9
