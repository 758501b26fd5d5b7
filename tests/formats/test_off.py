"""OFF: colours by its keyword, and damage."""

from __future__ import annotations

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
