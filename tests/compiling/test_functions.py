from __future__ import annotations

import subprocess
import sys

import numba
import numpy as np
import pytest
from from_python import from_python

from meshsimp_pymoo.compiling import linking
from meshsimp_pymoo.compiling.functions import entry, inner


def make_pair():
    """An inner function, and an entry that calls it with every kind of integer."""

    @inner
    def place(values: np.ndarray, at: int, by: float, skip: bool) -> float:
        return values[at] * by + (1.0 if skip else 0.0)

    @entry
    def total(values: np.ndarray, narrow: np.ndarray, unsigned: np.ndarray) -> float:
        return (
            place(values, 0, 1, False)
            + place(values, narrow[0], 2.0, True)
            + place(values, unsigned[0], 1.0, narrow[0] > 0)
            + place(values, len(values) - 1, 1.0, narrow[0] == 1)
        )

    return place, total


ARRAYS = np.arange(4.0), np.array([1], np.int32), np.array([2], np.uint32)
SUM = 0.0 + (2.0 + 1.0) + (2.0 + 1.0) + (3.0 + 1.0)


needs_known = pytest.mark.skipif(
    not linking.is_known(), reason=f"Numba {numba.__version__} is used by its public decorators alone"
)


@needs_known
def test_an_inner_function_is_compiled_once_for_all_kinds_of_integers():
    place, total = make_pair()
    assert total(*ARRAYS) == SUM
    assert len(place.overloads) == 1


@needs_known
def test_an_inner_function_refuses_to_be_called_by_python():
    place, _ = make_pair()
    with pytest.raises(TypeError, match=r"place is called by compiled code only; call it in a function compiled"):
        place(np.arange(3.0), 1, 1.0, False)
    assert from_python(place)(np.arange(3.0), 1, 2.0, True) == 3.0
    assert place.py_func(np.arange(3.0), 1, 2.0, True) == 3.0


def test_a_division_by_zero_is_infinite_as_in_numpy():
    @entry
    def over(a: float, b: float) -> float:
        return a / b

    assert over(1.0, 0.0) == np.inf


def test_an_unknown_numba_is_used_by_its_public_decorators_alone(monkeypatch):
    monkeypatch.setattr(linking, "KNOWN", ())
    place, total = make_pair()
    assert not isinstance(place, linking.LinkedFunction)
    assert total(*ARRAYS) == SUM
    assert place(np.arange(3.0), 1, 2.0, True) == 3.0
    assert len(place.overloads) > 2  # which is why


def test_this_numba_is_a_known_one():
    """If not: run the tests of this room with it, the slow ones too, and enter it."""
    assert linking.is_known(), f"Numba {numba.__version__} is not in {linking.KNOWN}"


RESULTS = """
import hashlib
import numpy as np
from meshsimp_pymoo import MeshProblem, thinning
from meshsimp_pymoo.search.local_search import relocate
problem = MeshProblem("horseshoe:150")
front = thinning(problem.surface)
kept = relocate(problem.surface, front.kept(60), moves=20000, seed=1, triangles=80)
table = problem.evaluate_subsets(np.array([front.kept(k) for k in range(0, len(front), 5)]))
print(hashlib.sha256(b"".join(x.tobytes() for x in (front.order, front.error, kept, table))).hexdigest())
"""
UNKNOWN = "from meshsimp_pymoo.compiling import linking; linking.KNOWN = ()\n"


@pytest.mark.slow
@pytest.mark.parametrize("level", ["1", "3"])
@pytest.mark.parametrize("numba_is", ["known", "unknown"])
def test_the_same_bytes_whatever_compiles_them(tmp_path, monkeypatch, capsys, level, numba_is):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_OPT", level)
    monkeypatch.setenv("NUMBA_LOOP_VECTORIZE", "0" if level == "1" else "1")
    code = (UNKNOWN if numba_is == "unknown" else "") + RESULTS
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=600)
    exec(RESULTS, {})
    assert found.stdout == capsys.readouterr().out
