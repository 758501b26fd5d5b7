"""Links to what other projects document: their pages by the beginnings of names, without asking the network."""

from __future__ import annotations

from typing import Any

from docutils import nodes

# The longest beginning that fits is taken.
PAGES = {
    "pymoo.core.problem": "https://pymoo.org/problems/definition.html",
    "pymoo.core.algorithm": "https://pymoo.org/algorithms/index.html",
    "pymoo.core.callback": "https://pymoo.org/interface/callback.html",
    "pymoo.core.result": "https://pymoo.org/interface/result.html",
    "pymoo.core.indicator": "https://pymoo.org/misc/indicators.html",
    "pymoo.core.sampling": "https://pymoo.org/operators/sampling.html",
    "pymoo.core.crossover": "https://pymoo.org/operators/crossover.html",
    "pymoo.core.mutation": "https://pymoo.org/operators/mutation.html",
    "pymoo.core.repair": "https://pymoo.org/operators/repair.html",
    "pymoo.core.termination": "https://pymoo.org/interface/termination.html",
    "pymoo.optimize.minimize": "https://pymoo.org/interface/minimize.html",
    "pymoo.algorithms.moo.nsga2": "https://pymoo.org/algorithms/moo/nsga2.html",
    "pymoo.algorithms.moo.nsga3": "https://pymoo.org/algorithms/moo/nsga3.html",
    "pymoo.algorithms.moo.moead": "https://pymoo.org/algorithms/moo/moead.html",
    "pymoo": "https://pymoo.org/index.html",
    "trimesh.Trimesh": "https://trimesh.org/trimesh.base.html#trimesh.base.Trimesh",
    "trimesh": "https://trimesh.org",
    "numpy.ndarray": "https://numpy.org/doc/stable/reference/generated/numpy.ndarray.html",
    "numpy": "https://numpy.org/doc/stable/reference/index.html",
    "pandas.DataFrame": "https://pandas.pydata.org/docs/reference/api/pandas.DataFrame.html",
    "matplotlib": "https://matplotlib.org/stable/api/index.html",
}


def find(app: Any, env: Any, node: Any, inside: Any) -> nodes.reference | None:
    """Return a link for a name that none of our pages has."""
    target = node.get("reftarget", "")
    fitting = [name for name in PAGES if target == name or target.startswith(f"{name}.")]
    if not fitting:
        return None
    return nodes.reference("", "", inside, internal=False, refuri=PAGES[max(fitting, key=len)])


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.connect("missing-reference", find)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
