"""OBJ: seams, negative indices and polygons."""

from __future__ import annotations

from numpy.testing import assert_array_equal
from pyramid import write

from meshsimp_pymoo.formats.table import read_source


def test_an_obj_with_texture_seams_negative_indices_and_polygons_stays_whole(tmp_path):
    text = """# a comment
mtllib missing.mtl
v 0 0 0
v 1 0 0 # the second
v 1 1 0.5
v 0 1 \\
 0.25
vt 0 0
vt 1 0
vn 0 0 1
usemtl left
f 1/1/1 2/2/1 3/1/1
usemtl right
f 1//1 3//1 4//1
v 2 0 0
f -4/2 -1/1 -3/1 -2/2
"""
    source = read_source(write(tmp_path, "seams.obj", text))
    assert_array_equal(source.points, [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0.25], [2, 0, 0]])
    assert_array_equal(source.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2], [1, 2, 3]])
