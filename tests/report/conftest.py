"""One browser for the tests of each page."""

from __future__ import annotations

import pytest
from browser import launched, playwright_engine


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
