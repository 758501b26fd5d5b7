"""Fixtures shared by the whole suite."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import pytest
from browser import launched, playwright_engine
from counts import SLOW
from hypothesis import settings
from sketching import sketch, sketch_into, sketch_pictures

from meshsimp_pymoo.report import figures, statement_figures
from meshsimp_pymoo.warming import PARTS, SEARCH, Warming

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")

SHARED = Path(__file__).resolve().parents[2] / "shared"

# Examples of each property that Hypothesis tries.
EXAMPLES = 30
settings.register_profile("plain", max_examples=EXAMPLES, deadline=None)
settings.register_profile("slow", max_examples=SLOW * EXAMPLES, deadline=None)


def pytest_configure(config: pytest.Config) -> None:
    """Try as many examples as are asked for."""
    settings.load_profile("slow" if config.option.markexpr == "slow" else "plain")


def pytest_itemcollected(item: pytest.Item) -> None:
    """Let ``-m slow`` try properties too."""
    if item.config.option.markexpr == "slow" and getattr(getattr(item, "obj", None), "is_hypothesis_test", False):
        item.add_marker("slow")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Divide folders among two processes, on any machine: some tests start two themselves. A file is quicker in one."""
    return 2 if any((config.invocation_params.dir / argument).is_dir() for argument in config.args) else 0


def pytest_xdist_setupnodes() -> None:
    """Compile what is missing before the processes begin, or both would."""
    with Warming(part.name for part in PARTS) as warming:
        warming.finish()


@pytest.fixture(scope="session", autouse=True)
def _compiled() -> None:
    """Compile what searches need, in two processes, where it is missing: else the first test that searches does."""
    with Warming(SEARCH) as warming:
        warming.finish()


@pytest.fixture(scope="module", autouse=True)
def _settled() -> None:
    """Let the garbage collector pass over what there is by now: the command collects it all, .1 to .3 s each time."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="module")
def sketched():
    """Let the commands of a module draw sketches, a tenth of the work, but for tests that ask for `drawn`."""
    from meshsimp_pymoo.comparison import report

    pictures = [
        (figures, "front_figure", figures.front_figure),
        (statement_figures, "pictures", statement_figures.pictures),
        (report, "_save", report._save),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "front_figure", sketch)
        patch.setattr(statement_figures, "pictures", sketch_pictures)
        patch.setattr(report, "_save", sketch_into)
        yield pictures


@pytest.fixture
def drawn(sketched, monkeypatch):
    """Let a test of such a module draw its pictures."""
    for place, name, draw in sketched:
        monkeypatch.setattr(place, name, draw)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real open meshes beside the checkout; tests that need it skip where it is absent."""
    folder = SHARED / "data"
    if not folder.is_dir():
        pytest.skip(f"no real meshes: the folder {folder.name!r} of shared test data is not beside this checkout")
    return folder


@pytest.fixture(scope="session")
def oracle() -> Path:
    """Return the independent referee script beside the checkout; tests that need it skip where it is absent."""
    script = SHARED / "oracle" / "vertical_error.py"
    if not script.is_file():
        pytest.skip("no independent referee: vertical_error.py is not beside this checkout")
    return script


@pytest.fixture(scope="module")
def engine():
    """Return Playwright; its event loop ends with the module, so that other tests may have their own."""
    with playwright_engine() as found:
        yield found


@pytest.fixture(scope="module")
def browser(engine):
    """Return a browser; tests that need it skip where there is none."""
    with launched(engine) as found:
        yield found


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the tests that can go on for long be told how long."""
    parser.addoption("--fuzz-cases", type=int, default=100, help="damaged inputs of each kind (default: %(default)s)")
    parser.addoption("--fuzz-seed", type=int, default=1, help="of the damage (default: %(default)s)")
    parser.addoption("--soak", type=int, default=10, help="simplifications in one process (default: %(default)s)")
