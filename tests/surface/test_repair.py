"""Small defects of scans: what is mended, how many are said, and what is left as it is."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from meshsimp_pymoo.errors import ModelError, ModelWarning
from meshsimp_pymoo.formats.options import Options
from meshsimp_pymoo.formats.source import SourceMesh, build_source
from meshsimp_pymoo.formats.source.heights import grid_source
from meshsimp_pymoo.opening import mended_source, open_model
from meshsimp_pymoo.surface.orient import front_patch, surface_facts
from meshsimp_pymoo.surface.repair import Mended, mend


def sheet(n: int = 20) -> SourceMesh:
    """Return a hilly square of n x n vertices, 2 (n - 1)^2 faces, as a mesh and not as a grid."""
    i = np.arange(n)
    grid = grid_source(2 * np.sin(0.5 * i)[:, None] + 1.5 * np.cos(0.7 * i), 1.0, 1.0)
    return build_source(grid.points, grid.faces, name="sheet.ply")


def with_faces(source: SourceMesh, faces: np.ndarray) -> SourceMesh:
    return build_source(source.points, faces, name=source.name)


def moved(points: np.ndarray, x: float, z: float = 0.0) -> np.ndarray:
    return points + np.array([x, 0.0, z])


def with_fins(source: SourceMesh, number: int, rows: int = 1) -> SourceMesh:
    """Return a sheet with fins that stand on inner edges of it, each a strip of some rows of faces."""
    n = round(len(source.points) ** 0.5)
    points, faces = [source.points], [source.faces]
    for k in range(number):
        a, b = 2 * n + 2 + 3 * k, 3 * n + 2 + 3 * k
        for row in range(rows):
            top = sum(map(len, points)) + np.arange(2)
            points.append(source.points[[2 * n + 2 + 3 * k, 3 * n + 2 + 3 * k]] + [0, 0, row + 1])
            faces.append(np.array([[a, b, top[0]], [b, top[1], top[0]]]))
            a, b = top
    return build_source(np.vstack(points), np.vstack(faces), name="fins.ply")


def test_what_has_no_defect_comes_back_as_it_is():
    source = sheet()
    for whole in (source, grid_source(np.eye(5), 1.0, 1.0), with_faces(source, source.faces[:, ::-1])):
        mesh, mended = mend(whole)
        assert mesh is whole
        assert mended == Mended()
        assert str(mended) == ""


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 2, 0], [2, 1, 0]])
def test_of_faces_listed_again_the_first_stays_however_they_are_wound(order):
    source = sheet()
    mesh, mended = mend(with_faces(source, np.vstack([source.faces, source.faces[100:103][:, order]])))
    assert mended == Mended(repeated=3)
    assert_array_equal(mesh.faces, source.faces)
    assert surface_facts(mesh, mesh.points).border_loops == 1


def test_a_sheet_with_two_sides_has_one_afterwards():
    source = sheet()
    mesh, mended = mend(with_faces(source, np.vstack([source.faces, source.faces[::-1, ::-1]])))
    assert mended == Mended(repeated=len(source.faces))
    assert_array_equal(mesh.faces, source.faces)


def test_a_face_listed_many_times_stays_once_wherever_the_repeats_stand():
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    mesh, mended = mend(build_source(corners, [[0, 1, 2]] * 15_000 + [[0, 2, 3]] + [[2, 1, 0]] * 7))
    assert mended == Mended(repeated=15_006)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@given(share=st.floats(0.01, 0.45), seed=st.integers(0, 1000), backwards=st.booleans())
def test_faces_wound_the_other_way_are_turned_as_most_of_the_area_is(share, seed, backwards):
    source = sheet(12)
    against = np.random.default_rng(seed).random(len(source.faces)) < share
    faces = source.faces[:, ::-1] if backwards else source.faces
    area = surface_area(source)
    if area[against].sum() > 0.49 * area.sum():
        return
    mesh, mended = mend(with_faces(source, np.where(against[:, None], faces[:, ::-1], faces)))
    assert mended == Mended(turned=int(against.sum()))
    assert_array_equal(np.sort(mesh.faces, axis=1), np.sort(faces, axis=1))
    facts = surface_facts(mesh, mesh.points)
    assert (facts.folds, facts.hidden, facts.inconsistent_edges, facts.flipped) == (0, 0, 0, backwards)


def surface_area(source: SourceMesh) -> np.ndarray:
    a, b, c = (source.points[source.faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def test_each_part_is_wound_as_most_of_its_own_area_and_one_with_one_side_only_stays():
    source = sheet(6)
    faces = source.faces.copy()
    faces[3] = faces[3, ::-1]
    away = source.faces[:, ::-1] + 36
    away[7] = away[7, ::-1]
    points = np.vstack([source.points, moved(source.points, 20)])
    mesh, mended = mend(build_source(points, np.vstack([faces, away])))
    assert mended == Mended(turned=2)
    assert_array_equal(mesh.faces, np.vstack([source.faces, source.faces[:, ::-1] + 36]))
    # a strip of eight triangles, closed after half a turn
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    band = np.c_[np.cos(angle), np.sin(angle), np.arange(8) % 2]
    strip = np.array([[k, k + 1, k + 2] for k in range(7)]) % 7
    moebius = build_source(band[:7], strip)
    mesh, mended = mend(moebius)
    assert mesh is moebius
    assert mended == Mended()


def test_a_tile_wound_against_the_one_it_touches_is_turned():
    source = sheet()
    # the second is the mirror image of the first, so that its faces are wound the other way
    mirrored = moved(source.points * [-1, 1, 1], 38 - 1e-7)
    mesh, mended = mend(
        build_source(np.vstack([source.points, mirrored]), np.vstack([source.faces, source.faces + 400]))
    )
    assert mended == Mended(turned=722)
    facts = surface_facts(mesh, mesh.points)
    assert (facts.folds, facts.hidden, facts.flipped) == (0, 0, False)


def test_fins_are_dropped_with_all_that_hangs_on_them():
    source = sheet(30)
    fins = with_fins(source, 3, rows=2)
    mesh, mended = mend(fins)
    assert mended == Mended(extra=12)
    assert_array_equal(mesh.faces, source.faces)
    assert mesh.points is fins.points


def test_more_than_one_in_a_hundred_faces_at_edges_of_others_is_no_small_defect():
    source = sheet(20)  # 722 faces: 3 fins of two faces are 0.82 % of 728, 4 are 1.10 % of 730
    assert mend(with_fins(source, 3))[1] == Mended(extra=6)
    fins = with_fins(source, 4)
    mesh, mended = mend(fins)
    assert mended == Mended()
    with pytest.raises(ModelError, match=r"4 edges belong to more than two faces .*--patch front"):
        open_model(mesh, Options(up="z"))


def test_of_many_faces_at_one_edge_the_flattest_pair_stays():
    source = sheet(60)
    a, b = 30 * 60 + 30, 31 * 60 + 30
    n = len(source.points)
    tips = source.points[a] + np.c_[np.sin(np.arange(40)), np.cos(np.arange(40)), np.full(40, 3.0)]
    mesh, mended = mend(
        build_source(np.vstack([source.points, tips]), [*source.faces, *([a, b, n + k] for k in range(40))])
    )
    assert mended == Mended(extra=40)
    assert_array_equal(mesh.faces, source.faces)


def test_what_was_mended_is_said_once_with_its_numbers_and_none_leaves_it():
    source = with_fins(sheet(), 1)
    faces = np.vstack([source.faces, source.faces[100:103]])
    faces[::60] = faces[::60, ::-1]
    broken = build_source(source.points, faces, name="broken.ply")
    told = (
        "broken.ply: 3 faces listed twice and dropped, 2 faces that stand on edges of two others dropped, 13 faces "
        "wound against the others turned (--repair none (repair='none') leaves them)"
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        open_model(broken)
    spare = "broken.ply: 2 of 402 vertices belong to no face and are left out"
    assert sorted(str(warning.message) for warning in caught) == sorted([spare, told])
    mesh, mended = mended_source(broken)
    assert (mended.repeated, mended.extra, mended.turned) == (3, 2, 13)
    assert_array_equal(mesh.faces, sheet().faces)
    with pytest.raises(ModelError, match=r"^broken.ply: \d+ edges belong to more than two faces"):
        open_model(broken, Options(repair="none"))
    turned = with_faces(sheet(), np.where(np.arange(722)[:, None] % 60 == 0, sheet().faces[:, ::-1], sheet().faces))
    with pytest.raises(ModelError, match=r"at least 13 of 722 faces \(1.80%\) are folded over .*orient them alike"):
        open_model(turned, Options(up="z", repair="none"))


def test_the_front_of_a_sheet_with_faces_wound_the_other_way_has_no_holes():
    source = sheet()
    faces = source.faces.copy()
    faces[::7] = faces[::7, ::-1]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        patch, mended = mended_source(with_faces(source, faces), Options(up="z", patch="front"))
    assert mended == Mended(turned=104)
    assert_array_equal(patch.faces, source.faces)
    with pytest.warns(
        ModelWarning, match=r"^sheet.ply: 104 of 722 faces \(1\d.\d\d% of the area\) are left out of the "
    ):
        patch = front_patch(with_faces(source, faces), "z")
    assert len(patch.faces) == 618


@pytest.mark.parametrize("gap", [-1e-7, 0.0, 1e-7])
def test_the_front_takes_both_of_two_tiles_that_touch_within_single_precision(gap):
    source = sheet()
    tiles = build_source(
        np.vstack([source.points, moved(source.points, 19 + gap, 1)]), np.vstack([source.faces, source.faces + 400])
    )
    facts = surface_facts(tiles, tiles.points)
    assert (facts.hidden, facts.refusal, facts.components) == (0, None, 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        patch = front_patch(tiles, "z")
    assert len(patch.faces) == 1444
    apart = build_source(
        np.vstack([source.points, moved(source.points, 19.1, 1)]),
        np.vstack([source.faces, source.faces + 400]),
        name="two",
    )
    with pytest.warns(ModelWarning, match=r"^two: 722 of 1444 faces \(50.00% of the area\) .* in 1 piece$"):
        assert len(front_patch(apart, "z").faces) == 722


def test_a_sheet_above_a_part_of_the_ground_is_no_part_of_it_although_their_outlines_coincide():
    ground = sheet()
    part = ground.faces[(ground.points[ground.faces, 0] <= ground.points[:, 0].min() + 8).all(axis=1)]
    used, numbers = np.unique(part, return_inverse=True)
    points = np.vstack([ground.points, ground.points[used] + [0, 0, 5]])
    both = build_source(points, np.vstack([ground.faces, numbers.reshape(-1, 3) + len(ground.points)]), name="two")
    with pytest.warns(ModelWarning, match=rf"^two: {len(part)} of \d+ faces"):
        patch = front_patch(both, "z")
    assert_array_equal(patch.points[:, 2].max(), ground.points[:, 2].max())
