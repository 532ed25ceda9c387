"""A browser without a window, for pictures and film."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from mobman.errors import MobmanError

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

T = TypeVar("T")

VARIABLE = "MOBMAN_BROWSER"
"""Environment variable that may name the browser's program."""
_PROGRAMS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
)
# WebGL by the processor, so that a picture is the same with and without a graphics card
_FLAGS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_PATIENCE = 120_000.0  # ms


class BrowserError(MobmanError):
    """There is no browser that could take a picture, or it failed."""


class BrowserMissingError(BrowserError):
    """Neither Chromium nor Chrome is installed, or the package that drives it is not."""


def in_browser(document: str, size: tuple[int, int], act: Callable[[Page], T]) -> T:
    """Open a page in a browser without a window and do something with it.

    Args:
        document: The page.
        size: Width and height of the window (pixels).
        act: What to do when the page is ready; its result is returned.

    Raises:
        BrowserError: If playwright or a browser is missing, or the page does not open.
    """
    # a thread of its own: playwright's plain interface refuses to run where an event loop does, as in
    # a notebook
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(_run, document, size, act).result()


def _run(document: str, size: tuple[int, int], act: Callable[[Page], T]) -> T:
    with browser() as running, tempfile.TemporaryDirectory(prefix="mobman-") as folder:
        from playwright.sync_api import Error

        file = Path(folder) / "page.html"
        file.write_text(document, encoding="utf-8")
        try:
            page = running.new_page(viewport={"width": size[0], "height": size[1]})
            page.set_default_timeout(_PATIENCE)
            page.goto(file.as_uri())
            page.evaluate("window.mobman.ready")
            page.evaluate("window.mobman.picture()")
            return act(page)
        except Error as error:
            raise BrowserError(f"the browser failed: {str(error).splitlines()[0]}") from error


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser without a window; it is closed at the end.

    Raises:
        BrowserMissingError: If playwright or a browser is missing.
        BrowserError: If the browser does not start, or ``MOBMAN_BROWSER`` names no program.
    """
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError as error:
        raise BrowserMissingError(
            "pictures and film need the package playwright; install it with: "
            "pip install 'mobman[film]'"
        ) from error
    program = _program()
    with sync_playwright() as playwright:
        try:
            running = playwright.chromium.launch(executable_path=program, args=list(_FLAGS))
        except Error as error:
            reason = str(error).splitlines()[0]
            if program is None and "Executable doesn't exist" in reason:
                raise BrowserMissingError(
                    "pictures and film need Chromium or Chrome, and there is none; install one, or "
                    f"name its program in the environment variable {VARIABLE}"
                ) from error
            name = program or "that playwright has installed"
            raise BrowserError(f"the browser {name} does not start: {reason}") from error
        try:
            yield running
        finally:
            running.close()


def _program() -> str | None:
    """The browser's program; None for the one that playwright may have downloaded."""
    named = os.environ.get(VARIABLE)
    if named:
        found = shutil.which(named)
        if found is None:
            raise BrowserError(f"{VARIABLE} = {named!r}: there is no such program")
        return found
    return next((found for name in _PROGRAMS if (found := shutil.which(name))), None)
