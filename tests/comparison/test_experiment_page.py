"""The page of an experiment: fronts to look at, verdicts, tables and configuration, from any names."""

from __future__ import annotations

import json

import numpy as np
import pytest
from browser import Visit, faults
from handmade import BUDGET, store
from PIL import Image

from meshsimp_pymoo.comparison import report as experiment
from meshsimp_pymoo.comparison.findings import CLAIMS, findings
from meshsimp_pymoo.comparison.findings_page import shown_claims
from meshsimp_pymoo.comparison.page import experiment_page
from meshsimp_pymoo.comparison.study import Study

EVIL = "</script><img src=http://127.0.0.1:9/x onerror=alert(1)>"
GOOD = {seed: [(1.0 + seed / 10, 100.0), (4.0, 20.0), (9.0, 5.0)] for seed in (1, 2, 3)}
POOR = {seed: [(3.0 + seed / 10, 110.0), (8.0, 30.0)] for seed in (1, 2, 3)}
CLASSIC = {"M1": {"quadric_collapse": [(2.0, 90.0, True), (0.0, 120.0, True)]}}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    fronts = {"M1": {"N1": GOOD, "G1": POOR}, EVIL: {"N1": GOOD, "G1": POOR}}
    out = store(tmp_path_factory.mktemp("study") / "out", fronts, classic=CLASSIC, title=f"Title {EVIL}")
    figures = out / "figures" / "9-generations" / "every-vertex"
    study = Study(out)
    for name in ("hvr", "meshes_M1"):
        folder = out / "figures" / "9-generations" / study.scorings[0]
        folder.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.full((40, 3000, 3), 200, np.uint8)).save(folder / f"{name}.png")
    assert not figures.exists()
    return study


@pytest.fixture(scope="module")
def page(study):
    return experiment_page(study, findings(study, BUDGET, study.scorings[0]))


@pytest.fixture(scope="module")
def visit(browser, page, tmp_path_factory):
    path = tmp_path_factory.mktemp("visit") / "report.html"
    path.write_text(page, encoding="utf-8")
    visit = Visit(browser, path, viewport={"width": 1100, "height": 900})
    yield visit
    visit.check()
    visit.close()


def test_every_verdict_stands_in_the_table_of_findings(visit, study):
    found = findings(study, BUDGET, study.scorings[0])
    shown = shown_claims(CLAIMS, found)
    assert [claim.key for claim in shown] == [
        "multi_over_single",
        "multi_over_classic",
        "single_over_classic",
        "extent",
        "selected",
    ]
    cells = visit.page.locator("#findings td.verdict").all_inner_texts()
    assert cells == [f.verdict for f in found if f.claim in shown]


def test_the_readers_own_comparison_comes_first(visit, study, tmp_path, browser):
    sections = visit.page.evaluate("[...document.querySelectorAll('section')].map((section) => section.id)")
    assert sections[0] == "methods"
    assert sections.index("findings") > sections.index("methods") + 2
    rows = visit.page.locator("#methods tbody tr").all_inner_texts()
    assert [row.split()[0] for row in rows] == ["N1", "G1", "MeshLab"]
    own = Study(store(tmp_path / "own", {"M1": {"N1": GOOD, "G1": POOR, "Mine": POOR}}))
    path = tmp_path / "own.html"
    path.write_text(experiment_page(own, findings(own, BUDGET, "nearest")), encoding="utf-8")
    folded = Visit(browser, path, viewport={"width": 1100, "height": 900})
    assert folded.page.locator("#findings details").get_attribute("open") is None
    assert visit.page.locator("#findings details").get_attribute("open") == ""
    folded.check()
    folded.close()
    alone = Study(store(tmp_path / "alone", {"M1": {"Mine": POOR, "Other": GOOD}}))
    assert 'id="findings"' not in experiment_page(alone, findings(alone, BUDGET, "nearest"))


def test_fronts_are_drawn_and_methods_can_be_left_out(visit):
    chart = visit.page.locator("#chart-0")
    chart.scroll_into_view_if_needed()
    visit.page.wait_for_selector("#chart-0[data-drawn]")
    names = chart.locator(".legend li").all_inner_texts()
    assert [name.strip() for name in names] == ["pseudo-optimal", "N1", "G1", "MeshLab quadric"]
    drawn = chart.locator(":scope > svg path.series")
    before = drawn.count()
    chart.locator(".legend input").nth(2).uncheck()
    assert drawn.count() == before - 2  # its points, and how far half of its runs get
    ticks = chart.locator(".axes").inner_html()
    visit.page.uncheck("#log-x")
    assert chart.locator(".axes").inner_html() != ticks


def test_on_paper_all_fronts_are_drawn(browser, page, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    visit = Visit(browser, path, viewport={"width": 500, "height": 200})
    waiting = visit.page.locator("[id^=chart-]:not([data-drawn])")
    assert waiting.count() > 0
    visit.page.pdf()
    assert waiting.count() == 0
    assert visit.page.locator("[id^=chart-] path.series").count() > 0
    visit.check()
    visit.close()


def test_errors_have_their_unit_and_models_their_system(tmp_path):
    out = store(tmp_path / "out", {"M1": {"N1": GOOD, "G1": POOR}})
    record = json.loads((out / "experiment.json").read_text(encoding="utf-8"))
    assert "errors in</th>" in experiment_page(Study(out), [])  # and a record of before says nothing of them
    record["problems"][0] |= {"unit": "US survey foot", "system": "EPSG:2263"}
    (out / "experiment.json").write_text(json.dumps(record), encoding="utf-8")
    said = experiment_page(Study(out), [])
    assert "<td>US survey foot</td><td>EPSG:2263</td>" in said
    assert '"label":"error, sum over all original vertices [US survey foot]"' in said


def test_pictures_are_embedded_no_wider_than_can_be_shown(visit):
    widths = visit.page.evaluate("[...document.images].map((image) => [image.src.slice(0, 23), image.naturalWidth])")
    assert widths == [["data:image/webp;base64,", 1600]] * 2


def test_names_cannot_run_anything(visit, page):
    assert visit.page.title() == f"Title {EVIL}"
    assert visit.page.inner_text("h1") == f"Title {EVIL}"
    assert "<img src=http" not in page
    assert f"{EVIL}: fronts merged over runs" in visit.page.locator("h3").all_inner_texts()


def test_tables_and_configuration_can_be_opened(visit):
    for summary in visit.page.locator("summary").all():
        if summary.locator("..").get_attribute("open") is None:
            summary.click()
    assert "seeds:\n- 1\n- 2\n- 3" in visit.page.inner_text("#configuration")
    tables = visit.page.locator("table.data").all_inner_texts()
    assert any("4 (0)" in text or "HVR" in text for text in tables)
    assert any("90" in text and "MeshLab quadric" in text for text in tables)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_a_phone_and_has_no_fault(browser, page, tmp_path, scheme):
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    visit = Visit(browser, path, viewport={"width": 360, "height": 740}, color_scheme=scheme)
    assert visit.page.evaluate("document.documentElement.scrollWidth") == 360
    assert faults(visit) == []
    visit.check()
    visit.close()


def test_the_seconds_of_a_search_are_those_of_the_runs(study, page):
    shown = page[page.index('id="times"') :]
    # 1.01, 1.02 and 1.03 s for both methods on both models
    assert shown[: shown.index("</section>")].count("1.02") == 4


def test_a_report_ends_with_the_page(study, monkeypatch):
    monkeypatch.setattr(experiment, "_write_figures", lambda study, progress: None)
    experiment.write_report(study.out)
    assert f"<h1>{'Title'}" in (study.out / "report.html").read_text(encoding="utf-8")
