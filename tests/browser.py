"""A real browser for the tests of the pages: Debian's Chromium or whatever of its kind is installed."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from node import module

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Software graphics, and none of the browser's own calls to its makers. Its sandbox does not start for root.
ARGUMENTS = (
    "--no-sandbox", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-quic", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
)  # fmt: skip


@contextmanager
def playwright_engine() -> Iterator[Any]:
    """Yield Playwright; skip the test where it is not installed."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no Playwright: pip install playwright")
    with playwright.sync_playwright() as engine:
        yield engine


@contextmanager
def launched(engine: Any, *more: str) -> Iterator[Any]:
    """Yield a browser, started with more arguments; skip the test where there is none."""
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"no browser: none of {', '.join(BROWSERS)} is installed (Debian: apt install chromium)")
    browser = engine.chromium.launch(executable_path=program, args=[*ARGUMENTS, *more])
    try:
        yield browser
    finally:
        browser.close()


class Visit:
    """A page from the disk, opened in a browser, with all that it said and asked for.

    A program draws it, so it has a quarter of the pixels of a common screen unless it is said to have all.
    """

    def __init__(self, browser: Any, path: Path, *, ready: str = "html[data-ready]", **look: Any) -> None:
        self.context = browser.new_context(accept_downloads=True, **{"device_scale_factor": 0.5} | look)
        self.page = self.context.new_page()
        self.said: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda problem: self.said.append(str(problem)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.url = path.resolve().as_uri()
        self.page.goto(self.url)
        self.page.wait_for_selector(ready, timeout=20_000)

    def close(self) -> None:
        self.context.close()

    def check(self) -> None:
        """Fail if the page said anything on the console or asked for anything but itself."""
        assert self.said == []
        away = [url for url in self.asked if url != self.url and not url.startswith(("data:", "blob:"))]
        assert away == []


def faults(visit: Visit) -> list[str]:
    """Return what axe-core finds wrong, all of a page unfolded, as lines."""
    script = (module("axe-core") / "axe.min.js").read_text(encoding="utf-8")
    visit.page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    visit.page.evaluate(script)
    found = visit.page.evaluate("axe.run(document, { resultTypes: ['violations'] })")["violations"]
    return [f"{rule['impact']} {rule['id']}: {rule['nodes'][0]['html'][:100]}" for rule in found]
