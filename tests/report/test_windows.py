"""The windows of a page's meshes: how they look, what is compared, and what of it is taken home."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from browser import Visit
from pages import chunks, dress, pixels, relief, scale_of_errors, shown, taken, unlike, until
from PIL import Image
from sketching import sketch

from meshsimp_pymoo import MeshProblem
from meshsimp_pymoo.formats.material import Material
from meshsimp_pymoo.formats.source import build_source
from meshsimp_pymoo.formats.table import read_source
from meshsimp_pymoo.front import Front
from meshsimp_pymoo.report import colours as colours_module
from meshsimp_pymoo.report import figures as figures_module
from meshsimp_pymoo.report.colours import embedded_image, hypsometric
from meshsimp_pymoo.report.page import HEIGHT_DECADES, SCALE_QUANTILE, _heights
from meshsimp_pymoo.surface.surface import LEAST_RELIEF, MOST_RELIEF, View

SIDE = 16
DESK = {"width": 920, "height": 1000}
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def picture(*corners):
    """Return the PNG of an image of four plain quarters."""
    rgb = np.kron(np.array(corners, np.uint8).reshape(2, 2, 3), np.ones((8, 8, 1), np.uint8))
    stream = io.BytesIO()
    Image.fromarray(rgb).save(stream, "PNG")
    return stream.getvalue()


RED, GREEN, BLUE, GREY = [220, 30, 30], [30, 190, 30], [30, 60, 220], [120, 120, 120]


@pytest.fixture(scope="module")
def front(tmp_path_factory):
    """A front with its page, of terrain with an image on it whose first axis goes to the north, its second one east."""
    points, faces, _ = relief(SIDE, np.random.default_rng(3))
    uv = ((points[:, :2] - points[:, :2].min(axis=0)) / np.ptp(points[:, :2], axis=0))[:, ::-1]
    facts = {"epsg": 32633, "unit": "metre"}
    points = points + np.array([4e5, 5e6, 700])
    source = build_source(points, faces, name="hill.obj", attributes={"uv": uv}, georeference=facts)
    problem = MeshProblem(replace(source, material=Material(image=picture(RED, GREEN, BLUE, GREY))), n_threads=1)
    place = np.random.default_rng(3).permutation(problem.n_var)
    kept = np.array([place < size for size in np.geomspace(8, 0.9 * problem.n_var, 8)]) | problem.pinned
    front = Front.from_subsets(problem, kept, ends=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_module, "front_figure", sketch)
        folder = front.save(tmp_path_factory.mktemp("windows") / "out", meshes=0, chosen=3)
    return Front.load(folder, model=problem.surface)


@pytest.fixture(scope="module")
def opened(browser, front):
    visit = Visit(browser, front.folder / "report.html", viewport=DESK)
    yield visit
    visit.close()


AS_OPENED = """() => {
  for (const input of document.querySelectorAll("section:has(#canvas) input")) {
    if (input.type === "range") input.value = input.defaultValue;
    else if (input.checked === input.defaultChecked) continue;
    else input.checked = input.defaultChecked;
    const said = input.type === "range" ? "input" : "change";
    if (input.type !== "radio" || input.checked) input.dispatchEvent(new Event(said));
  }
  pick(data.chosen);
  document.getElementById("reset").click();
}"""


@pytest.fixture
def page(opened):
    """The page as it opens; afterwards it must have kept quiet."""
    opened.page.evaluate(AS_OPENED)
    opened.page.wait_for_selector("html[data-shown='3']")
    yield opened.page
    opened.check()


def on_screen(page):
    """Return where the original's vertices are in the window, -1 to 1, (V, 2)."""
    page.evaluate(DRAWN)
    found = page.evaluate(
        """() => { const { camera, arrays, original, exaggeration } = state.viewer;
        camera.updateMatrixWorld(); camera.updateProjectionMatrix();
        return [...new Set(original.faces)].map((row) => {
          const at = new THREE.Vector3().fromArray(arrays.position, 3 * row); at.z *= exaggeration;
          return at.project(camera).toArray().slice(0, 2); }); }"""
    )
    return np.array(found)


def middle(window):
    height, width, _ = window.shape
    return window[height // 2 - 3 : height // 2 + 3, width // 2 - 3 : width // 2 + 3].reshape(-1, 3).mean(axis=0)


# -------------------------------------------------------------------------------------------------------- how they look


def slow_normals(points, faces, factor):
    """Return the normals at the corners of triangles (M, 3, 3), by the definition alone."""
    high = points * [1, 1, factor]
    a, b, c = (high[faces[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    found = np.zeros((len(faces), 3, 3))
    for t, triangle in enumerate(faces):
        for k, vertex in enumerate(triangle):
            for other, corner in zip(*np.nonzero(faces == vertex), strict=True):
                if face[t] @ face[other] < np.cos(np.radians(55)):
                    continue
                u, v = (high[faces[other, (corner + step) % 3]] - high[vertex] for step in (1, 2))
                found[t, k] += np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)) * face[other]
    found *= [1, 1, factor]
    return found / np.linalg.norm(found, axis=2, keepdims=True)


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_smooth_normals_are_the_means_of_faces_by_angle_but_not_beyond_creases(page, front, factor):
    points, faces = np.asarray(front.surface.points), front[4].faces
    found = page.evaluate(
        "([points, faces, factor]) => [...cornerNormals(Float32Array.from(points), Uint32Array.from(faces), factor)]",
        [points.ravel().tolist(), faces.ravel().tolist(), factor],
    )
    expected = slow_normals(points.astype(np.float32).astype(float), faces, factor)
    np.testing.assert_allclose(np.reshape(found, (-1, 3, 3)), expected, atol=2e-4)
    spread = np.linalg.norm(expected[:, 0] - expected[:, 1], axis=1)
    assert (spread > 1e-3).any()


def test_a_cube_stays_a_cube_on_smooth_surfaces(page):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[a, b, c] for a, b, c, _ in quads] + [[a, c, d] for a, _, c, d in quads])
    found = np.reshape(
        page.evaluate(
            "([points, faces]) => [...cornerNormals(Float32Array.from(points), Uint32Array.from(faces), 1)]",
            [corners.ravel().tolist(), faces.ravel().tolist()],
        ),
        (-1, 3, 3),
    )
    a, b, c = (corners[faces[:, k]] for k in range(3))
    np.testing.assert_allclose(found, np.repeat(np.cross(b - a, c - a)[:, None], 3, axis=1), atol=1e-6)


def test_smooth_surfaces_have_no_facets(page):
    dress(page, "plain", "flat")
    page.click("#from-above")
    page.uncheck("#hillshade")
    flat = pixels(page)
    dress(page, shading="smooth")
    smooth = pixels(page)
    assert unlike(smooth[1], flat[1]) > 0.1
    tones = [len(np.unique(window.reshape(-1, 3), axis=0)) for window in (flat[1], smooth[1])]
    assert tones[1] > 1.15 * tones[0]


def test_the_hillshade_stays_with_the_map_and_comes_from_the_north_west(page):
    dress(page, "plain", "flat")
    alike = {}
    for hillshaded in (True, False):
        page.set_checked("#hillshade", hillshaded)
        seen = []
        for azimuth in (0, np.pi):
            page.evaluate(f"state.viewer.look({azimuth}, 0)")
            window = pixels(page)[0]
            seen.append(window[::-1, ::-1] if azimuth else window)
        alike[hillshaded] = unlike(*(window[4:-4, 4:-4] for window in seen))
    assert alike[True] < 0.1 < 0.3 < alike[False]
    light = np.array(page.evaluate("MAP_LIGHT"))
    np.testing.assert_allclose(light / np.linalg.norm(light), [-0.5, 0.5, np.sqrt(0.5)])  # 45 degrees up
    tilted = [[-1, 1, 1.0], [1, -1, 1.0]]  # normals to the north-west and to the south-east
    assert light @ tilted[0] > light @ tilted[1]


def test_terrain_whose_system_is_known_opens_with_its_hillshade_and_its_image(page):
    assert page.is_checked("#hillshade")
    assert page.is_checked("input[name=colours][value=texture]")
    page.click("#from-above")
    for window in pixels(page):
        height, width, _ = window.shape
        quarters = [window[height // 2 + y, width // 2 + x] for y in (-30, 30) for x in (-30, 30)]
        for seen, painted in zip(quarters, (GREY, GREEN, BLUE, RED), strict=True):
            shade = seen.max() / max(painted)
            np.testing.assert_allclose(seen, np.array(painted) * shade, atol=16)


def test_heights_are_coloured_from_the_lowest_to_the_highest_with_a_legend_in_the_unit(page, front):
    dress(page, "height")
    assert page.inner_text("#key-name") == "height [m]"
    ticks = [float(text.replace(",", "")) for text in page.locator("#ticks span").all_inner_texts()]
    z = front.model.file_points[:, 2]
    assert ticks == sorted(ticks)
    np.testing.assert_allclose([ticks[0], ticks[-1]], [z.min(), z.max()], rtol=1e-3)
    shares = page.evaluate("[...state.viewer.arrays.uv2].filter((_, k) => k % 2 === 0)")
    np.testing.assert_allclose(shares, (z - z.min()) / np.ptp(z), atol=1e-5)
    assert not page.locator(".of-errors").first.is_visible()


def test_each_colour_of_heights_is_lighter_than_the_one_before():
    lightness = np.array(hypsometric()) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(lightness) > 0).all()
    assert lightness[-1] - lightness[0] > 100


def test_the_scale_of_errors_suits_the_shown_mesh_or_the_coarser_of_two(page, front):
    def fitted(row):
        return np.quantile(front[row].simplified.deviation, SCALE_QUANTILE, method="lower")

    dress(page, "error", "flat")
    assert page.inner_text("#key-name") == "error [m]"
    assert shown(page) == 3
    assert scale_of_errors(page) == pytest.approx(fitted(3), rel=0.02)
    page.click("#pin")
    page.locator("#slider").fill("7")
    assert shown(page) == 7
    assert scale_of_errors(page) == pytest.approx(fitted(3), rel=0.02)
    page.check("input[name=left][value=original]", force=True)
    assert scale_of_errors(page) == pytest.approx(fitted(7), rel=0.02)
    window = pixels(page)[1]  # which is neither all pale nor all dark
    tones = window[np.abs(window - window[2, 2]).max(axis=2) > 24].max(axis=1)
    assert np.quantile(tones, 0.95) - np.quantile(tones, 0.05) > 40


# ----------------------------------------------------------------------------------------------------------- where from


def test_terrain_fills_its_window_and_does_so_again_until_somebody_moves_it(page):
    def is_filled():
        reach = np.abs(on_screen(page)).max(axis=0)
        return reach.max() == pytest.approx(page.evaluate("FILLED"), abs=0.01)

    assert is_filled()
    page.click("#from-side")
    assert is_filled()
    page.locator("#heights").fill(page.locator("#heights").get_attribute("max"))
    assert is_filled()
    page.check("input[value=wipe]", force=True)
    assert is_filled()
    page.set_viewport_size({"width": 390, "height": 800})
    until(page, "document.getElementById('canvas').clientWidth < 390")
    assert is_filled()
    page.locator("#canvas").press("ArrowLeft")
    moved = camera_place(page)
    page.set_viewport_size(DESK)
    until(page, "document.getElementById('canvas').clientWidth > 390")
    page.evaluate(DRAWN)
    assert camera_place(page) == moved
    page.click("#reset")
    assert is_filled()


def camera_place(page):
    return page.evaluate("state.viewer.camera.position.toArray()")


@pytest.mark.parametrize(("height", "factor"), [(1e-4, 1200), (0.12, 1), (0.5, 1), (1.0, 1), (40.0, 0.025), (0.0, 1)])
def test_flat_reliefs_are_drawn_higher_and_needles_lower(height, factor):
    view = View(extent=np.array([1.0, 0.7, height]), rotation=np.eye(3), pivot=np.zeros(3))
    assert view.exaggeration == pytest.approx(factor)
    drawn = height * view.exaggeration
    assert drawn == 0 or LEAST_RELIEF * 0.999 <= drawn <= MOST_RELIEF * 1.001
    slider = {name: float(text) for name, text in _heights(view.exaggeration).items()}
    assert slider["least"] + HEIGHT_DECADES <= 0 <= slider["most"] - HEIGHT_DECADES  # true proportions are among them
    assert 10 ** slider["usual"] == pytest.approx(factor, rel=0.02)


def test_the_slider_of_heights_multiplies_and_finds_true_proportions(page):
    for exponent, factor in (("0.01", 1), ("0.7", 5), ("-0.7", 0.2), ("1.6", 10)):
        page.locator("#heights").fill(exponent) if float(exponent) <= 1 else page.locator("#heights").fill("1")
        assert page.evaluate("state.viewer.exaggeration") == pytest.approx(factor, rel=0.02)
        assert page.inner_text("#heights-value") == f"× {factor}"
        assert page.locator("#heights").get_attribute("aria-valuetext") == f"{factor} times as high"


def test_the_ruler_is_as_long_as_it_says_and_the_arrow_points_north(page):
    for azimuth, polar in ((0.0, 0.3), (2.0, 0.9)):
        page.evaluate(f"state.viewer.look({azimuth}, {polar})")
        page.evaluate(DRAWN)
        said = float(page.inner_text("#ruler-length").removesuffix(" m"))
        drawn = page.locator("#ruler-bar").bounding_box()["width"]
        assert 25 < drawn < 0.45 * page.locator("#original-window").bounding_box()["width"]
        # steps in the picture from what is looked at: to its right, and to the north
        across, north = page.evaluate(
            """(length) => { const { camera, controls, size } = state.viewer;
            const [, , width, height] = state.viewer.window(0);
            const at = (step) => controls.target.clone().add(step).project(camera);
            const none = at(new THREE.Vector3());
            const right = new THREE.Vector3(1, 0, 0).transformDirection(camera.matrixWorld);
            return [right.multiplyScalar(length / size), new THREE.Vector3(0, 0.01, 0)].map((step) => {
              const end = at(step); return [(end.x - none.x) * width / 2, (end.y - none.y) * height / 2]; }); }""",
            said,
        )
        assert across[0] == pytest.approx(drawn, abs=1.5)
        turned = page.evaluate("document.getElementById('north').style.transform")
        angle = np.radians(float(turned.removeprefix("rotate(").removesuffix("deg)")))
        np.testing.assert_allclose([np.sin(angle), np.cos(angle)], north / np.linalg.norm(north), atol=0.03)


# ----------------------------------------------------------------------------------------------------- what is compared


def test_a_pinned_solution_stays_on_the_left_while_others_are_picked(page, front):
    original = pixels(page)[0]
    page.click("#pin")
    left, right = pixels(page)
    assert unlike(left, original) > 0.02
    pinned, simplified = (page.evaluate(f"[...state.viewer.{part}.faces]") for part in ("pinned", "simplified"))
    assert pinned == simplified
    page.locator("#slider").fill("7")
    assert shown(page) == 7
    after = pixels(page)
    assert unlike(after[0], left) == 0
    assert unlike(after[1], right) > 0.02
    caption = page.locator("figcaption").first.inner_text()
    assert caption.startswith(f"solution 3 {front[3].triangles:,} triangles")
    dress(page, "error", "smooth")
    errors = [page.evaluate(f"[...state.viewer.{part}.errors.array]") for part in ("pinned", "simplified")]
    assert errors[0] != errors[1]
    page.check("input[name=left][value=original]", force=True)
    dress(page, "texture", "flat")
    assert unlike(pixels(page)[0], original) < 0.001
    assert page.locator("figcaption").first.inner_text().startswith("original")


def test_the_divider_of_a_wipe_shows_more_of_one_mesh_or_of_the_other(page):
    page.click("#pin")
    page.locator("#slider").fill("0")
    assert shown(page) == 0
    assert not page.locator("#divider").is_visible()
    dress(page, arrangement="wipe")

    def windows():
        return np.concatenate(pixels(page), axis=1)

    divider = page.locator("#divider")
    divider.press("Home")
    right = windows()
    divider.press("End")
    left = windows()
    assert unlike(left, right) > 0.05
    for _ in range(10):
        divider.press("ArrowLeft")
    assert divider.get_attribute("aria-valuenow") == "50"
    both, middle = windows(), left.shape[1] // 2
    aside = 12  # the handle
    assert unlike(both[:, : middle - aside], left[:, : middle - aside]) < 0.003
    assert unlike(both[:, middle + aside :], right[:, middle + aside :]) < 0.003
    box = divider.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + 20
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 100, y, steps=2)
    page.mouse.up()
    moved = 100 / page.locator("#canvas").bounding_box()["width"]
    assert float(page.evaluate("state.viewer.divider")) == pytest.approx(0.5 + moved, abs=0.01)
    dress(page, arrangement="beside")
    assert not divider.is_visible()


def test_full_screen_is_all_meshes_and_arrows_on_a_button_still_pick(page):
    page.click("#full-screen")
    until(page, "document.fullscreenElement !== null")
    assert page.locator("#canvas").bounding_box()["width"] > 0.95 * DESK["width"]
    assert page.locator(".in-full-screen").is_visible()
    before = shown(page)
    page.keyboard.press("ArrowRight")
    assert shown(page) == before + 1
    page.click("#full-screen")
    until(page, "document.fullscreenElement === null")


def test_a_saved_picture_is_what_is_seen_with_title_numbers_and_scale(page, front, tmp_path):
    dress(page, "height", "smooth")
    seen = pixels(page)
    with page.expect_download() as download:
        page.click("#picture")
    assert download.value.suggested_filename == f"hill_{front[3].triangles}.png"
    download.value.save_as(tmp_path / "seen.png")
    with Image.open(tmp_path / "seen.png") as image:
        drawn = np.asarray(image.convert("RGB")).astype(int)
    box = page.locator("#canvas").bounding_box()
    assert drawn.shape[1] == pytest.approx(2 * (box["width"] + 28), abs=2)
    lines = drawn.min(axis=2).min(axis=1)
    assert (lines[20:100] < 90).any()  # the title
    assert (lines[-70:] < 90).any()  # the ticks
    # the screen here has a quarter of the pixels in each direction
    window = page.locator("#original-window").bounding_box()
    left, top = 2 * (14 + window["x"] - box["x"]), 2 * (54 + window["y"] - box["y"])
    part = drawn[round(top) : round(top + 2 * window["height"]), round(left) : round(left + 2 * window["width"])]
    small = np.asarray(Image.fromarray(part.astype(np.uint8)).resize(seen[0].shape[1::-1], Image.Resampling.BOX))
    assert unlike(small.astype(int)[4:-4, 4:-4], seen[0][4:-4, 4:-4]) < 0.12
    assert unlike(pixels(page)[0], seen[0]) == 0


def test_a_graphics_card_that_fails_is_said_and_comes_back(browser, front):
    visit = Visit(browser, front.folder / "report.html", viewport=DESK)
    try:
        page = visit.page
        before = pixels(page)
        page.evaluate(
            "window.lost = state.viewer.renderer.getContext().getExtension('WEBGL_lose_context'); lost.loseContext()"
        )
        until(page, "!document.getElementById('no-3d').hidden")
        assert "does not answer" in page.inner_text("#no-3d")
        assert not page.locator("#canvas").is_visible()
        page.locator("#slider").fill("5")
        assert shown(page) == 5
        page.locator("#slider").fill("3")
        page.evaluate("lost.restoreContext()")
        until(page, "document.getElementById('no-3d').hidden")
        assert max(unlike(*pair) for pair in zip(pixels(page), before, strict=True)) < 0.01
        page.locator("#slider").fill("0")
        assert shown(page) == 0
        assert unlike(pixels(page)[1], before[1]) > 0.02
    finally:
        visit.close()


# ------------------------------------------------------------------------------------------------------------ the image


def test_an_image_is_embedded_as_it_is_where_it_fits():
    content = picture(RED, GREEN, BLUE, GREY)
    found, word = embedded_image(Material(color=(1.0, 0.5, 0.0, 1.0), image=content))
    assert word == ""
    assert found["colour"] == "rgb(255, 128, 0)"
    kind, _, packed = found["image"].partition(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(packed) == content


def test_a_large_image_is_made_smaller_with_a_word(monkeypatch):
    monkeypatch.setattr(colours_module, "IMAGE_SIDE", 12)
    monkeypatch.setattr(colours_module, "SMALLER_SIDES", (12, 8))
    found, word = embedded_image(Material(image=picture(RED, GREEN, BLUE, GREY)))
    with Image.open(io.BytesIO(base64.b64decode(found["image"].partition(",")[2]))) as image:
        assert image.size == (12, 12)
        np.testing.assert_allclose(np.asarray(image.convert("RGB"))[1, 1], RED, atol=12)
    assert word.startswith("The texture of the model has 16 x 16 pixels; it is shown here with 12 x 12 of them.")
    monkeypatch.setattr(colours_module, "IMAGE_BYTES", 10)  # whatever is tried is too large: the smallest it is
    assert "8 x 8 of them" in embedded_image(Material(image=picture(RED, GREEN, BLUE, GREY)))[1]


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_an_image_that_cannot_be_read_is_left_out_with_a_word(kind):
    stream = io.BytesIO()
    Image.effect_noise((64, 64), 60).save(stream, kind)
    found, word = embedded_image(Material(image=stream.getvalue()[: len(stream.getvalue()) // 2]))
    assert found is None
    assert word.startswith("The texture of the model cannot be read (")


def test_an_image_that_the_browser_cannot_read_is_said(browser, front, tmp_path):
    page = (front.folder / "report.html").read_text(encoding="utf-8")
    image = re.search(r"data:image/png;base64,[^\"]*", page)[0]
    (tmp_path / "report.html").write_text(page.replace(image, "data:image/png;base64,AAAA"), encoding="utf-8")
    visit = Visit(browser, tmp_path / "report.html", viewport=DESK)
    try:
        assert "cannot read the texture" in visit.page.inner_text("#no-texture")
        assert not visit.page.locator("#no-3d").is_visible()
        assert visit.page.locator("input[value=texture]").count() == 0
        assert visit.page.is_checked("input[name=colours][value=plain]")
        assert len(np.unique(pixels(visit.page)[1].reshape(-1, 3), axis=0)) > 50
        visit.check()
    finally:
        visit.close()


def test_a_downloaded_glb_has_the_texture_as_the_package_writes_it(page, front, tmp_path):
    front[3].save(tmp_path / "package.glb")
    (ours, parts), (theirs, own) = chunks(taken(page, "glb", tmp_path)), chunks(tmp_path / "package.glb")
    assert ours == theirs
    assert [parts[0], *parts[2:-1]] == [own[0], *own[2:-1]]
    places = [np.frombuffer(there[1], "<f4") for there in (parts, own)]  # which the page holds in single precision
    np.testing.assert_allclose(*places, rtol=0, atol=1e-7)
    material = read_source(tmp_path / "page.glb").material
    assert material.image == front.model.material.image
    assert "GLB keeps the texture" in page.inner_text("section:has(#downloads)")
