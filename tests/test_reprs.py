"""What things say that they are, and what ``help()`` and editors say of their arguments."""

import ast
import copy
import dataclasses
import inspect
import pickle
import pydoc
from pathlib import Path

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.evaluator import Evaluator
from pymoo.optimize import minimize

import meshsimp_pymoo
from meshsimp_pymoo import (
    OAX,
    Cardinality,
    Coverage,
    Front,
    FrontOutput,
    HalfPlaneCrossover,
    HypervolumeRatio,
    LiveTriangulation,
    MeshProblem,
    Moves,
    MultiplicativeEpsilon,
    NeighbourShift,
    NestedSubsets,
    Options,
    PackedDuplicates,
    PinnedCorners,
    Processes,
    RandomSubset,
    RegionCrossover,
    Relocation,
    Rules,
    SizeStep,
    SubsetUniformCrossover,
    WeightedSum,
    fujiwara_sawai,
    huang_ho,
    memetic,
    moead,
    nsga2_v1,
    nsga2_v2,
    nsga3,
    open_grid,
    read_front,
    targeted,
    thinning,
    weighted_ga_v1,
)
from meshsimp_pymoo.formats.source import SourceMesh
from meshsimp_pymoo.opening import open_source
from meshsimp_pymoo.settings import settings_of
from meshsimp_pymoo.surface.closed.model import topology
from meshsimp_pymoo.surface.edges import Edges
from meshsimp_pymoo.surface.grid_surface import GridSurface
from meshsimp_pymoo.surface.surface import FreeMesh, Scored, View
from meshsimp_pymoo.workers import Serial

# A roof of 5 x 5 samples: the ridge has height 1, so that the corners alone miss 10 in all, in two triangles.
PROBLEM = MeshProblem("roof:5")
SURFACE = PROBLEM.surface
BODY = MeshProblem("sphere:100").surface
CORNERS = PROBLEM.simplify(PROBLEM.pinned)
FRONT = Front.from_subsets(PROBLEM, np.array([PROBLEM.pinned, np.ones(25, bool)]))
SAYS = "<MeshProblem roof:5: 25 vertices, minimise error and triangles; footprint model, outside nearest>"
NUMBERS = "2 triangles, error 10, mean 0.4, max 1"
PAPER = "RandomSubset(), SubsetUniformCrossover(), NeighbourShift(), PinnedCorners()"
F = [[1, 15], [0, 20]]


@pytest.mark.parametrize(
    ("thing", "said"),
    [
        (PROBLEM, SAYS),
        (
            MeshProblem(
                "roof:5",
                objectives=("rms_error", "max_error", "triangles"),
                max_triangles=5_000,
                max_objective=2.5,
                regions=4,
                pin="hull",
                weights=np.ones(25),
            ),
            "<MeshProblem roof:5: 25 vertices, minimise rms_error, max_error and triangles; triangles at most 5,000, "
            "rms_error at most 2.5, footprint model, outside nearest, pinned hull, weighted, error in 4 regions>",
        ),
        (WeightedSum(PROBLEM, 0.5), f"WeightedSum({SAYS}, 0.5)"),
        (PROBLEM.elementwise_runner, f"ThreadRunner(n_threads={PROBLEM.elementwise_runner.n_threads})"),
        # models and surfaces
        (PROBLEM.model, "<OpenModel roof:5: 25 vertices, 32 triangles, 2 x 2 x 1 model units>"),
        (
            dataclasses.replace(PROBLEM.model, weights=np.ones(25), georeference={"unit": "metre"}),
            "<OpenModel roof:5: 25 vertices, 32 triangles, weighted, 2 x 2 x 1 m>",
        ),
        (open_source("roof:5"), "<SourceMesh roof:5: grid of 25 vertices, 32 faces>"),
        (
            SURFACE,
            "<HeightSurface of roof:5: 25 vertices, 4 pinned, error measured; footprint model, outside nearest>",
        ),
        (
            MeshProblem("sphere:100"),
            "<MeshProblem sphere:100: 100 vertices, minimise error and triangles>",
        ),
        (BODY.model, "<ClosedModel sphere:100: 100 vertices, 196 triangles, 1.981 x 1.981 x 1.978 model units>"),
        (BODY, "<ClosedSurface of sphere:100: 100 vertices, 3 pinned, error measured>"),
        (
            topology(BODY.faces),
            "Topology(components=1, loops=0, rim_edges=0, crowded=0, touching=0, mismatched=0, genus=0, "
            "with_handles=0, fault=None)",
        ),
        (open_grid(np.zeros((40, 30))), "<HeightGrid grid: 40 rows of 30 samples>"),
        (
            GridSurface(open_grid(np.zeros((40, 30)))),
            "<GridSurface of grid: 1,200 samples; footprint model, outside nearest>",
        ),
        (
            LiveTriangulation(SURFACE, PROBLEM.pinned),
            "<LiveTriangulation of roof:5: 4 of 25 vertices kept, 2 triangles, error 10>",
        ),
        # settings
        (Options(), "Options()"),
        (Options(spacing=3, up="z"), "Options(up='z', spacing=(3.0, 3.0))"),
        (Rules(pin=list(range(10_000))), "Rules(pin=[0, 1, 2, 3, 4, 5, ...])"),
        # meshes and fronts
        (CORNERS, f"<Simplified: {NUMBERS}>"),
        (Scored(CORNERS.quality, CORNERS.deviation, CORNERS.covered), f"<Scored: {NUMBERS}>"),
        (FreeMesh(PROBLEM.pinned, CORNERS.faces, CORNERS.quality), f"<FreeMesh: {NUMBERS}>"),
        # at height h the corners miss |h| twenty times and |1 - h| five times; the four tops may rise
        (SURFACE.refit(CORNERS), "<Refitted: 2 triangles, error {0.error:.6g}, 10 before, at least {0.bound:.6g}>"),
        (FRONT, "<front of roof:5: 2 solutions, 2 to 32 triangles, error 10 to 0>"),
        (FRONT[0], f"<solution 0 of 2: {NUMBERS}>"),
        (thinning(SURFACE), "<NestedFront: 22 subsets of 25 vertices, 2 to 32 triangles, error 10 to 0>"),
        # operators
        (RandomSubset(), "RandomSubset()"),
        (RandomSubset((10, 0.5)), "RandomSubset(size=[10, 0.5])"),
        (NestedSubsets((2, 9)), "NestedSubsets(triangles=(2, 9))"),
        (OAX(), "OAX()"),
        (OAX("L8", prob=0.5, score=np.sum), "OAX(arrays='L8', prob=0.5, score=sum)"),
        (OAX(evaluator=Evaluator()), "OAX(evaluator=Evaluator())"),
        (SubsetUniformCrossover(0.9), "SubsetUniformCrossover(prob=0.9)"),
        (HalfPlaneCrossover(keep_size=True), "HalfPlaneCrossover(keep_size=True)"),
        (RegionCrossover(n_offsprings=1), "RegionCrossover(n_offsprings=1)"),
        (NeighbourShift(0.1, along="mesh"), "NeighbourShift(prob_var=0.1, along='mesh')"),
        (Relocation(max_moves=9), "Relocation(max_moves=9)"),
        (SizeStep(), "SizeStep()"),
        (PinnedCorners(), "PinnedCorners()"),
        (PackedDuplicates(), "PackedDuplicates()"),
        # algorithms
        (nsga2_v1(), f"<NSGA2: 100 individuals, {PAPER}>"),
        (nsga2_v2(2_000), f"<NSGA2: 2,000 individuals, {PAPER.replace('SubsetUniformCrossover', 'OAX')}>"),
        (nsga3(n_partitions=3), f"<NSGA3: 10 individuals, 10 directions, {PAPER}>"),
        (
            moead(20, n_neighbors=5, normalised=True),
            "<TchebycheffMOEAD: 20 sub-problems, 5 neighbours, objectives by their ranges, "
            f"{PAPER.replace('Crossover()', 'Crossover(n_offsprings=1)')}>",
        ),
        (weighted_ga_v1(0.3), f"<WeightedGA: w = 0.3, 100 individuals, {PAPER}>"),
        (
            fujiwara_sawai(20),
            "<WeightedGA: w = 1, 100 individuals, RandomSubset(size=20), HalfPlaneCrossover(prob=0.8, keep_size=True), "
            "NeighbourShift(), PinnedCorners()>",
        ),
        (
            huang_ho(0.1, 30),
            "<WeightedGA: w = 1, 30 individuals, RandomSubset(size=0.1), OAX(keep_size=True), NeighbourShift(), "
            "PinnedCorners()>",
        ),
        (memetic(), "<MemeticSearch: 100 rungs, NestedSubsets(), PinnedCorners()>"),
        (
            memetic(20, triangles=(2, 2_000), triangulation="free"),
            "<MemeticSearch: 20 rungs of 2 to 2,000 triangles, free meshes, NestedSubsets(triangles=(2, 2000)), "
            "PinnedCorners()>",
        ),
        (
            targeted(triangles=5_000, max_error=0.1),
            "<TargetedSearch: at most 5,000 triangles and a max error of at most 0.1>",
        ),
        # what goes with them
        (Moves(2_000_000), "Moves(2000000)"),
        (FrontOutput(), "<FrontOutput: 0 generations>"),
        (FrontOutput([20, 5_000]), "<FrontOutput at 20, 5,000 triangles: 0 generations>"),
        (Processes(2), "Processes(2)"),
        (Serial(), "Serial()"),
        (HypervolumeRatio([*F, [2, 10]], reference=1.2), "HypervolumeRatio(<(3, 2) float64>, reference=1.2)"),
        (MultiplicativeEpsilon(F, shift=1.0), "MultiplicativeEpsilon([[1.0, 15.0], [0.0, 20.0]], shift=1.0)"),
        (Coverage(F), "Coverage([[1.0, 15.0], [0.0, 20.0]])"),
        (Cardinality(), "Cardinality()"),
        (
            View(np.array([2.0, 2.0, 1.0]), np.eye(3), np.zeros(3)),
            "View(extent=[2.0, 2.0, 1.0], rotation=<(3, 3) float64>, pivot=[0.0, 0.0, 0.0], scale=[1.0, 1.0, 1.0], "
            "is_closed=False)",
        ),
    ],
    ids=lambda value: "" if isinstance(value, str) else type(value).__name__,
)
def test_each_thing_says_what_it_is_in_one_line(thing, said):
    assert repr(thing) == said.format(thing)


def test_what_has_run_says_how_far_it_has_come_and_copies_say_the_same():
    output = FrontOutput([2, 8])
    algorithm = minimize(PROBLEM, nsga2_v1(10), ("n_eval", 30), seed=1, callback=output).algorithm
    assert repr(algorithm) == f"<NSGA2: 10 individuals, {PAPER}; generation 3, 30 evaluations>"
    assert isinstance(algorithm, NSGA2)
    assert repr(output) == "<FrontOutput at 2, 8 triangles: 3 generations>"
    algorithm.callback = None
    assert repr(copy.deepcopy(algorithm)) == repr(pickle.loads(pickle.dumps(algorithm))) == repr(algorithm)


def test_a_front_read_back_says_where(tmp_path, sketched):
    FRONT.save(tmp_path / "out", meshes=0)
    said = repr(read_front(tmp_path / "out"))
    assert said == f"<StoredFront {tmp_path / 'out'}: 2 solutions, 2 to 32 triangles, error 10 to 0>"


def _records_with_arrays():
    """Yield the dataclasses of the package that have arrays, as they stand in its files."""
    for file in sorted(Path(meshsimp_pymoo.__file__).parent.rglob("*.py")):
        text = file.read_text("utf-8")
        for node in ast.parse(text).body if "\n@dataclass" in text else ():
            if isinstance(node, ast.ClassDef) and any("dataclass" in ast.unparse(d) for d in node.decorator_list):
                types = [ast.unparse(item.annotation) for item in node.body if isinstance(item, ast.AnnAssign)]
                if any("Array" in name or "ndarray" in name for name in types):
                    yield node


def test_no_record_prints_its_arrays():
    loud, names = [], set()
    for record in _records_with_arrays():
        names.add(record.name)
        own = any(getattr(part, "name", "") == "__repr__" for part in record.body)
        if not own and "brief" not in map(ast.unparse, record.decorator_list):
            loud.append(record.name)
    assert {"OpenModel", "Tile", "Scores", "SourceMesh"} <= names
    assert not loud, "these print all of their fields; decorate them by meshsimp_pymoo.reprs.brief"


def test_arrays_in_records_are_shape_and_type():
    mesh = SourceMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]), {}, "three")
    assert repr(mesh) == "<SourceMesh three: mesh of 3 vertices, 1 faces>"
    edges = Edges(*[np.zeros((9, 3))] * 4)
    assert repr(edges).startswith("Edges(faces=<(9, 3) float64>, order=<(9, 3) float64>, ")


def test_settings_are_named_with_their_defaults_wherever_they_are_taken_by_name():
    names = [name for kind in (Options, Rules) for name, known in settings_of(kind).items() if not known.derived]
    for of in (MeshProblem, MeshProblem.__init__):
        found = inspect.signature(of).parameters
        assert [name for name in found if name in names] == names
        assert (found["up"].default, found["footprint"].default, found["pin"].default) == ("auto", None, None)
        assert found["outside"].annotation == "str | None"
        assert found["memo"].default == 100_000
        assert list(found)[-1] == "kwargs"
        assert "measure" not in found
    found = inspect.signature(open_grid).parameters
    assert list(found)[:4] == ["model", "options", "surface", "up"]
    assert "footprint" not in found
    said = pydoc.plain(pydoc.render_doc(MeshProblem.__init__))
    assert "spacing: 'float | tuple[float, float] | None' = None" in said
    assert "n_ieq_constr" not in said


def test_a_subclass_has_its_own_signature():
    class Steep(MeshProblem):
        def __init__(self, slope):
            super().__init__("roof:3")
            self.slope = slope

    assert list(inspect.signature(Steep).parameters) == ["slope"]
    assert repr(Steep(2.0)).startswith("<Steep roof:3: 9 vertices, ")


def test_no_public_class_explains_itself_by_pymoos_words():
    for name in meshsimp_pymoo.__all__:
        public = getattr(meshsimp_pymoo, name)
        if inspect.isclass(public):
            assert not (inspect.getdoc(public.__init__) or "").startswith(("Initialize a", "Initialize t")), name
