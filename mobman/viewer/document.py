"""The page: one HTML file with everything in it, that opens without a network."""

from __future__ import annotations

import html
import importlib.util
import json
import re
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from mobman.errors import MobmanError
from mobman.printable import printable
from mobman.viewer.scene import Scene

_PLACES = re.compile(r"\{\{(\w+)\}\}")


def document(scene: Scene) -> str:
    """The page of a scene.

    Raises:
        MobmanError: If MeshCat's viewer is not installed as it should be.
    """
    meshcat, licence = _meshcat()
    parts = {
        "title": html.escape(printable(f"{scene.title} – mobman")),
        "style": _page_file("style.css"),
        "licence": licence.replace("--", "- -"),
        "scene": _embedded(scene.content),
        "meshcat": meshcat,
        "script": _script(),
    }
    return _PLACES.sub(lambda place: parts[place[1]], _page_file("template.html"))


def _embedded(content: dict[str, Any]) -> str:
    """JSON that cannot end the element that holds it."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


@cache
def _page_file(name: str) -> str:
    return (files("mobman.viewer") / "page" / name).read_text(encoding="utf-8")


@cache
def _script() -> str:
    """The page's own scripts, in the order of their names, in a scope of their own."""
    folder = files("mobman.viewer") / "page"
    names = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".js"))
    scripts = "\n".join(_page_file(name) for name in names)
    return f'(() => {{\n"use strict";\nconst THREE = MeshCat.THREE;\n{scripts}\n}})();'


@cache
def _meshcat() -> tuple[str, str]:
    """MeshCat's script, ready to be put into a page, and the licences that it asks to be kept."""
    try:
        spec = importlib.util.find_spec("meshcat")  # its Python side is not needed
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError("no package meshcat")
        folder = Path(spec.origin).parent / "viewer"
        script = (folder / "dist" / "main.min.js").read_text(encoding="utf-8")
        licence = (folder / "LICENSE").read_text(encoding="utf-8")
        others = (folder / "dist" / "main.min.js.LICENSE.txt").read_text(encoding="utf-8")
    except (ModuleNotFoundError, OSError) as error:
        raise MobmanError(
            f"MeshCat's viewer is not there ({error}); install it with: pip install --force-reinstall "
            "meshcat"
        ) from error
    return script.replace("</script", "<\\/script"), f"{licence}\n{others}"
