"""Run the scripts of docs/examples, draw their pictures, and write docs/gallery.md of them.

python docs/gallery.py [NAME ...]
"""

from __future__ import annotations

import ast
import runpy
import sys
import tempfile
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).parent
PICTURES = DOCS / "images" / "gallery"
NAMES = (
    *("compare_laws", "wrong_inertia", "pose_circle", "delay", "limits", "singularity"),
    *("ground", "own_law", "own_task", "own_robot", "suite_pandas"),
)
"""Scripts, in the order of the page."""
TOP = """# Gallery

Each picture is drawn by the script named with it, of ten to forty lines, which you can run as it
stands. Tests run each of them, shortened; `make gallery` runs them in full, draws the pictures, and
writes this page.
"""
WIDTH = 1000  # px


def words(name: str) -> tuple[str, str]:
    """First line of a script's docstring, and the rest."""
    text = (DOCS / "examples" / f"{name}.py").read_text(encoding="utf-8")
    first, _, rest = (ast.get_docstring(ast.parse(text)) or "").partition("\n\n")
    return first, rest


def page() -> str:
    """The gallery's page."""
    sections = [TOP]
    for name in NAMES:
        first, rest = words(name)
        sections.append(
            f"## {name.replace('_', ' ').capitalize()}\n\n{first} {rest}".rstrip()
            + f"\n[docs/examples/{name}.py](examples/{name}.py)\n\n"
            f"![{first.rstrip('.:')}](images/gallery/{name}.png)\n"
        )
    return "\n".join(sections)


def draw(name: str) -> None:
    """Run a script in full, and keep its picture, small."""
    script = runpy.run_path(str(DOCS / "examples" / f"{name}.py"))
    with tempfile.TemporaryDirectory() as folder:
        large = Path(folder) / f"{name}.png"
        script["main"](large)
        with Image.open(large) as picture:
            size = (WIDTH, round(picture.height * WIDTH / picture.width))
            small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    small.quantize(96).save(PICTURES / f"{name}.png", optimize=True)


def main() -> None:
    """Draw the pictures that are asked for, or all, and write the page."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or NAMES:
        print(name, flush=True)
        draw(name)
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
