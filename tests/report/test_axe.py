"""What axe-core, a checker of accessibility, finds wrong in the pages: nothing, by day, on a phone, without WebGL."""

from __future__ import annotations

import numpy as np
import pytest
from browser import Visit, faults, launched
from sketching import sketch

from meshsimp_pymoo import Front, MeshProblem
from meshsimp_pymoo.report import figures as figures_module

PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 1, "has_touch": True}
DESK = {"viewport": {"width": 1280, "height": 1000}}


def made(place, model, meshes):
    problem = MeshProblem(model, n_threads=1)
    rng = np.random.default_rng(5)
    kept = rng.random((4, problem.n_var)) < np.linspace(0.1, 0.9, 4)[:, None]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_module, "front_figure", sketch)
        return Front.from_subsets(problem, kept | problem.pinned, ends=True).save(place, meshes=meshes, chosen=1)


@pytest.fixture(scope="module", params=["jacksboro:40", "blob:200"])
def folder(request, tmp_path_factory):
    """A front of terrain, and one of a body."""
    return made(tmp_path_factory.mktemp("axe") / "out", request.param, 0)


@pytest.mark.parametrize(("scheme", "look"), [("light", DESK), ("dark", PHONE)])
def test_the_page_of_a_simplification_has_no_fault(browser, folder, scheme, look):
    visit = Visit(browser, folder / "report.html", color_scheme=scheme, **look)
    visit.page.check("input[name=colours][value=error]", force=True)
    visit.page.click("#pin")
    visit.page.check("input[value=wipe]", force=True)
    visit.page.select_option("#axis", "max_error")
    visit.page.fill("#most-triangles", "1")
    visit.page.click("#by-triangles button")
    assert faults(visit) == []
    visit.close()


@pytest.mark.parametrize(("scheme", "look"), [("light", PHONE), ("dark", DESK)])
def test_neither_has_the_page_of_a_statement_of_quality(browser, folder, scheme, look):
    visit = Visit(browser, folder / "quality.html", ready="main", color_scheme=scheme, **look)
    assert faults(visit) == []
    visit.check()
    visit.close()


def test_without_webgl_it_has_none_either(engine, folder):
    with launched(engine, "--disable-3d-apis") as blind:
        visit = Visit(blind, folder / "report.html", **DESK)
        assert faults(visit) == []
