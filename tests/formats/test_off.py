"""OFF: colours by its keyword, and damage."""

from __future__ import annotations

import warnings

import pytest
import trimesh
from numpy.testing import assert_array_equal
from pyramid import COLORS, FACES, POINTS, refusal, write

from meshsimp_pymoo.formats.table import read_source


@pytest.mark.parametrize(
    ("keyword", "extra"), [("COFF", "{0} {1} {2} 255"), ("CNOFF", "0 0 1 {0} {1} {2} 255"), ("OFF", "")]
)
def test_an_off_keeps_colours_and_skips_normals_and_face_colours(tmp_path, keyword, extra):
    positions = [" ".join(map(repr, point)) for point in POINTS.tolist()]
    rows = [f"{position} {extra.format(*color)}" for position, color in zip(positions, COLORS, strict=True)]
    rows += ["3 " + " ".join(map(str, face)) + " 200 100 0" for face in FACES]
    source = read_source(write(tmp_path, "a.off", f"{keyword}\n# counts\n5 4 0\n\n" + "\n".join(rows)))
    assert_array_equal(source.points, POINTS)
    assert_array_equal(source.faces, FACES)
    if extra:
        assert_array_equal(source.attributes["color"], COLORS)
    else:
        assert source.attributes == {}


def test_a_damaged_off_is_refused(tmp_path):
    off = trimesh.Trimesh(POINTS, FACES, process=False).export(file_type="off")
    lines = off.splitlines()
    for count in range(1, len(lines)):
        refusal(write(tmp_path, "cut.off", "\n".join(lines[:count])))
    assert "4000000000" in refusal(write(tmp_path, "hostile.off", "OFF\n4000000000 1 0\n0 0 0\n"))
    assert "too few indices" in refusal(write(tmp_path, "short.off", off.replace("3 0 1 4", "3 0 1")))
    assert "fewer than 3" in refusal(write(tmp_path, "flat.off", "OFF\n2 1 0\n0 0 0\n0 1\n3 0 1 1\n"))


BODY = "0 0 0\n1 0 0\n0 1 0\n1 1 2\n3 0 1 2\n3 1 3 2\n"


@pytest.mark.parametrize(
    "head", ["OFF4 2 0\n", "OFF 4 2 0\n", "4 2 0\n", "4 2\n", "\ufeffOFF\n4 2 5\n", "\ufeff4 2 0 # counts\n"]
)
def test_the_keyword_of_an_off_may_be_missing_or_run_into_the_counts(tmp_path, head):
    source = read_source(write(tmp_path, "a.off", head + BODY))
    assert_array_equal(source.points, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 2]])
    assert_array_equal(source.faces, [[0, 1, 2], [1, 3, 2]])


@pytest.mark.parametrize(
    ("keyword", "beside", "said"),
    [
        ("STOFF", "0.5 0.5", "its texture coordinates stay behind"),
        ("NOFF", "0 0 1", None),
        ("OFF", "0 0 1", "have 6 numbers, its keyword names 3 of them"),
        ("NOFF", "0 0 1 9", "have 7 numbers, its keyword names 6 of them"),
    ],
)
def test_what_stays_behind_of_an_off_is_said(tmp_path, keyword, beside, said):
    lines = BODY.splitlines()
    text = "\n".join([f"{keyword}\n4 2 0", *(f"{line} {beside}" for line in lines[:4]), *lines[4:]])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert_array_equal(read_source(write(tmp_path, "a.off", text)).points[3], [1, 1, 2])
    assert [said in str(warning.message) for warning in caught] == ([] if said is None else [True])


@pytest.mark.parametrize("keyword", ["4OFF", "nOFF\n3", "ST4nOFF\n5"])
def test_an_off_of_other_dimensions_is_refused(tmp_path, keyword):
    assert "another number of coordinates than 3" in refusal(write(tmp_path, "a.off", f"{keyword}\n4 2 0\n{BODY}"))
