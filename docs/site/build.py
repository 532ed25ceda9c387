"""Build the documentation site: python docs/site/build.py build/site

A warning is an error, a link that leads nowhere and a formula that cannot be read among them.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path

from pages import write_pages

HERE = Path(__file__).parent


def main() -> None:
    """Write the pages, generated ones too, and let Sphinx make the site of them."""
    parser = argparse.ArgumentParser(description="Build the documentation site.")
    parser.add_argument("folder", type=Path, help="folder of the site; what is in it goes")
    folder = parser.parse_args().folder
    os.environ["NUMBA_DISABLE_JIT"] = "1"  # a run of five ticks needs no compiled code
    from reference import write_reference
    from sphinx.cmd.build import build_main

    with tempfile.TemporaryDirectory() as scratch:
        staged, built = Path(scratch) / "pages", Path(scratch) / "site"
        try:
            write_pages(staged)
        except FileNotFoundError as error:
            sys.exit(f"build.py: a link leads nowhere: {error}")
        write_reference(staged / "reference")
        failed = build_main(
            [
                *("-q", "-W", "--keep-going", "-b", "html", "-c", str(HERE)),
                *("-d", str(Path(scratch) / "doctrees"), str(staged), str(built)),
            ]
        )
        if failed:
            sys.exit("build.py: the site has faults, see above")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(built, folder)
    print(f"{folder / 'index.html'}")


if __name__ == "__main__":
    main()
