"""Make the stored results again: ``python tests/goldens/make.py [NAME ...]``, by default all.

A NAME is that of a module ``test_golden_NAME.py`` in this folder.
"""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
# robots that the user of this machine has added are not stored
os.environ["XDG_DATA_HOME"] = tempfile.mkdtemp(prefix="mobman-goldens-")


def main(names: list[str]) -> None:
    """Make the files of the modules with these names."""
    modules = sorted(path.stem for path in HERE.glob("test_golden_*.py"))
    known = [module.removeprefix("test_golden_") for module in modules]
    if unknown := set(names) - set(known):
        sys.exit(f"{', '.join(sorted(unknown))}: not among {', '.join(known)}")
    goldens = importlib.import_module("support.goldens")
    goldens.making = True
    for name in names or known:
        began = time.process_time()
        importlib.import_module(f"test_golden_{name}").make()
        print(f"{name}: {time.process_time() - began:.0f} s of processor time")


if __name__ == "__main__":
    main(sys.argv[1:])
