"""Where names lead: of this package to their pages, of other projects to theirs, without asking the network."""

from __future__ import annotations

import contextlib
import inspect
import re
import sys
from functools import cache
from importlib import import_module
from importlib.metadata import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docutils import nodes

import meshsimp_pymoo

PACKAGE = metadata("meshsimp-pymoo")
URLS = dict(line.split(", ", 1) for line in PACKAGE.get_all("Project-URL"))
SOURCE = f"{URLS['Source']}/blob/main"
NUMPY = "https://numpy.org/doc/stable/reference"
PYTHON = "https://docs.python.org/3/library"
PYMOO = "https://pymoo.org"
# The longest beginning that fits is taken.
PAGES = {
    "pymoo.core.problem": f"{PYMOO}/problems/definition.html",
    "pymoo.core.algorithm": f"{PYMOO}/algorithms/index.html",
    "pymoo.core.callback": f"{PYMOO}/interface/callback.html",
    "pymoo.core.population": f"{PYMOO}/customization/initialization.html",
    "pymoo.core.result": f"{PYMOO}/interface/result.html",
    "pymoo.core.indicator": f"{PYMOO}/misc/indicators.html",
    "pymoo.core.sampling": f"{PYMOO}/operators/sampling.html",
    "pymoo.core.crossover": f"{PYMOO}/operators/crossover.html",
    "pymoo.core.mutation": f"{PYMOO}/operators/mutation.html",
    "pymoo.core.repair": f"{PYMOO}/operators/repair.html",
    "pymoo.core.termination": f"{PYMOO}/interface/termination.html",
    "pymoo.parallelization": f"{PYMOO}/parallelization/index.html",
    "pymoo.util.display": f"{PYMOO}/interface/display.html",
    "pymoo.optimize.minimize": f"{PYMOO}/interface/minimize.html",
    "pymoo.algorithms.moo.nsga2": f"{PYMOO}/algorithms/moo/nsga2.html",
    "pymoo.algorithms.moo.nsga3": f"{PYMOO}/algorithms/moo/nsga3.html",
    "pymoo.algorithms.moo.moead": f"{PYMOO}/algorithms/moo/moead.html",
    "pymoo.algorithms.moo.spea2": f"{PYMOO}/algorithms/moo/spea2.html",
    "pymoo.algorithms.soo.nonconvex.ga": f"{PYMOO}/algorithms/soo/ga.html",
    "pymoo": f"{PYMOO}/index.html",
    "trimesh.Trimesh": "https://trimesh.org/trimesh.base.html#trimesh.base.Trimesh",
    "trimesh": "https://trimesh.org",
    "numpy.ndarray": f"{NUMPY}/generated/numpy.ndarray.html",
    "numpy.random.Generator": f"{NUMPY}/random/generator.html",
    "numpy.random": f"{NUMPY}/random/index.html",
    "numpy": f"{NUMPY}/index.html",
    "pandas.DataFrame": "https://pandas.pydata.org/docs/reference/api/pandas.DataFrame.html",
    "matplotlib.axes": "https://matplotlib.org/stable/api/_as_gen/matplotlib.axes.Axes.html",
    "matplotlib": "https://matplotlib.org/stable/api/index.html",
    "collections.abc": f"{PYTHON}/collections.abc.html",
    "pathlib.Path": f"{PYTHON}/pathlib.html#pathlib.Path",
    "os.PathLike": f"{PYTHON}/os.html#os.PathLike",
}
# Names that are met in the package but not public, by where they are at home: those that the page of Python lists.
API = Path(__file__).parent.parent / "reference" / "api.md"
FURTHER = re.findall(r"^   ((?:\w+\.)+\w+)$", API.read_text(encoding="utf-8"), re.MULTILINE)
# Names of others that docstrings spell out.
WHOLE = ("trimesh.Trimesh", "pandas.DataFrame", "numpy.random.Generator", "pymoo.core.evaluator.Evaluator")
# What a word means as the type of a parameter; itself: no link.
TYPES = {
    **{name.rpartition(".")[2]: f"meshsimp_pymoo.{name}" for name in (*meshsimp_pymoo.__all__, *FURTHER)},
    **{name: f":py:obj:`{name}`" for name in WHOLE},
    "Population": "pymoo.core.population.Population",
    "Result": "pymoo.core.result.Result",
    "axes": "matplotlib.axes.Axes",
    "Path": "pathlib.Path",
    **{word: "os.PathLike" for word in ("path", "path-like")},
    **{word: f"collections.abc.{word.capitalize()}" for word in ("sequence", "mapping", "iterable", "callable")},
    **{word: "numpy.ndarray" for word in ("array", "array-like")},
    **{
        word: word
        for word in ("int", "float", "bool", "str", "string", "list", "tuple", "dict", "None", "True", "False")
    },
}


@cache
def homes() -> dict[str, str]:
    """Return what is public by where it is at home, as docstrings inside the package spell it."""
    found = {}
    for name in meshsimp_pymoo.__all__:
        thing = getattr(meshsimp_pymoo, name)
        found[f"{thing.__module__}.{thing.__name__}"] = f"meshsimp_pymoo.{name}"
    return found


def find(app: Any, env: Any, node: Any, inside: Any) -> nodes.reference | None:
    """Return a link for a name that no page of ours has as it is spelled."""
    target = node.get("reftarget", "")
    for start in _beginnings(target):
        known = homes().get(start) or ("" if "." in start else TYPES.get(start, ""))
        if known.startswith("meshsimp_pymoo."):
            spelled = known + target[len(start) :]
            domain = env.get_domain("py")
            return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", spelled, node, inside)
        if start in PAGES:
            return nodes.reference("", "", inside, internal=False, refuri=PAGES[start])
    file = _source_of(target)
    if file is None:
        return None
    return nodes.reference("", "", inside, internal=False, refuri=f"{SOURCE}/{file}")


def _source_of(name: str) -> str | None:
    """Return the file of the repository in which a name of ours is; None if it is nowhere."""
    if not name.startswith("meshsimp_pymoo."):
        return None
    for module in _beginnings(name):
        with contextlib.suppress(ModuleNotFoundError):  # a part of it is no package
            if (found := find_spec(module)) and found.origin:
                thing: Any = import_module(module)
                for part in name[len(module) + 1 :].split(".") if name != module else ():
                    if not hasattr(thing, part):
                        return None
                    thing = getattr(thing, part)
                return str(Path(found.origin).relative_to(Path(meshsimp_pymoo.__file__).parent.parent))
    return None


def _beginnings(name: str) -> list[str]:
    """Return a dotted name and all that it begins with, the longest first."""
    parts = name.split(".")
    return [".".join(parts[:count]) for count in range(len(parts), 0, -1)]


def linkcode_resolve(domain: str, info: dict[str, str]) -> str | None:
    """Return where the repository has the source of what a page documents."""
    thing: Any = sys.modules.get(info["module"])
    try:
        for part in info["fullname"].split("."):
            thing = getattr(thing, part)
        thing = inspect.unwrap(getattr(thing, "fget", None) or getattr(thing, "func", thing))
        file, line = Path(inspect.getsourcefile(thing) or ""), inspect.getsourcelines(thing)[1]
        inside = file.relative_to(Path(meshsimp_pymoo.__file__).parent.parent)
    except (AttributeError, OSError, TypeError, ValueError):  # it has no source, or not ours
        return None
    return f"{SOURCE}/{inside.as_posix()}#L{line}"


def name_bases(app: Any, name: str, thing: Any, options: Any, bases: list[Any]) -> None:
    """Show a public parent in place of one that is private."""
    for place, base in enumerate(bases):
        if inspect.isclass(base):
            bases[place] = next(kind for kind in base.__mro__ if not kind.__name__.startswith("_"))


def drop_object(app: Any, doctree: nodes.document) -> None:
    """Leave out that a class is an object."""
    for paragraph in [*doctree.findall(nodes.paragraph)]:
        if paragraph.astext() in ("Bases: object", "Bases: tuple"):
            paragraph.parent.remove(paragraph)


def shorten(app: Any, kind: str, name: str, thing: Any, options: Any, signature: str, returned: str) -> Any:
    """Leave out what settings are by default where they are the default of an argument."""
    return signature and re.sub(r"\b(Rules|Options)\([^()]*\)", r"\1()", signature), returned


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx."""
    app.connect("missing-reference", find)
    app.connect("autodoc-process-bases", name_bases)
    app.connect("autodoc-process-signature", shorten)
    app.connect("doctree-read", drop_object)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
