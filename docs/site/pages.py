"""The pages of the site: docs/*.md and the repository's other pages, with the links of the repository
turned to the site's, a page for each file that they lead to, and the table of contents."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[2]
ELSEWHERE = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    "CODE_OF_CONDUCT.md": "code_of_conduct.md",
    "results/README.md": "results_folder.md",
}
"""Pages of the repository that are not in docs."""
CONTENTS = {
    "Start": {
        "start": "Start in five minutes",
        "contents": "What is in here",
        "gallery": "Gallery",
    },
    "Tutorials": {
        "robots": "Your own robot",
        "own_law": "Your own law",
        "own_task": "Your own task and scenario",
        "own_suite": "A suite and its report",
        "results": "Runs with xarray and pandas",
        "report": "Figures for a paper",
        "running": "A cluster",
        "deploy": "On a robot",
    },
    "How to add each thing": {
        "contributing": "One new file each",
        "packages": "In a package of your own",
        "platform_types": "A platform type",
    },
    "Theory": {
        "theory": "Equations, errata, discretisation",
    },
    "Results": {
        "comparisons": "What the comparisons say",
        "findings": "Questions, answers, commands",
        "suites": "Suites, and what they say",
        "ground": "Wheels on the ground",
        "uncertain": "Uncertain J and B",
        "speed": "Speed",
        "results_folder": "The folder of results",
    },
    "How results are kept honest": {
        "honesty": "Measures, and their limits",
        "limitations": "Known limitations",
        "statistics": "Statistics of the report",
        "tuning": "Tuning with one budget",
    },
    "In depth": {
        "controllers": "Controllers",
        "tasks": "Tasks",
        "platforms": "Platforms",
        "scenarios": "Scenarios",
        "metrics": "Metrics",
        "viewer": "Viewer",
        "bridges": "Bridges to other tools",
        "command_line": "Command line",
        "security": "Security",
        "release": "Releases",
        "code_of_conduct": "Code of conduct",
    },
    "Reference": {
        "reference/api_robots": "API: robots",
        "reference/api_laws": "API: laws and tasks",
        "reference/api_runs": "API: runs and scenarios",
        "reference/api_suites": "API: suites",
        "reference/api_others": "API: viewer and errors",
        "reference/api_extending": "API: for your own additions",
        "reference/command_line": "Commands",
        "reference/robot_file": "Robot file",
        "reference/suite_file": "Suite file",
        "reference/scenario_file": "Scenario file",
        "reference/record_file": "Record of a run",
        "changelog": "Changelog",
    },
}
"""The navigation: captions, and under each the pages with their titles there."""
LANGUAGES = {".py": "python", ".toml": "toml", ".sh": "bash", ".cff": "yaml"}
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s]+)(\))")
FILE = re.compile(r"(?<!\[)`((?:mobman|robots|benchmarks)/[\w/.-]+\.(?:py|toml))`")
CELL = re.compile(r"\| `([\w/]+\.py)` \|")


def anchor(heading: str) -> str:
    """Anchor of a heading as a forge makes it, which the links of the pages are written for."""
    heading = re.sub(r"[`*$]", "", heading)
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def place(file: str) -> str:
    """Page or file of the site for a file of the repository, from its root."""
    if file.startswith("docs/") and file.endswith((".md", ".png", ".svg")):
        return file.removeprefix("docs/")
    return ELSEWHERE.get(file) or f"source/{file}.md"


def linked(text: str, file: str) -> tuple[str, set[str]]:
    """The text of a page for the site, and the files it leads to that have no page of their own.

    Args:
        text: Markdown.
        file: Of the page, from the repository's root.

    Raises:
        FileNotFoundError: If a link leads to no file.
    """
    sources, here = set(), PurePosixPath(place(file)).parent

    def of_file(name: str) -> str:
        if place(name).startswith("source/"):
            sources.add(name)
        return os.path.relpath(place(name), here)

    def turn(target: str) -> str:
        path, hash_, fragment = target.partition("#")
        if not path or re.match(r"[a-z]+:", target):
            return target
        there = os.path.normpath(PurePosixPath(file).parent / path)
        if not (ROOT / there).is_file():
            raise FileNotFoundError(f"{file}: {target}")
        return of_file(there) + hash_ + fragment

    def named(found: re.Match[str], name: str) -> str:
        return f"[`{found[1]}`]({of_file(name)})" if (ROOT / name).is_file() else found[0]

    def prose(part: str) -> str:
        part = LINK.sub(lambda found: found[1] + turn(found[2]) + found[3], part)
        part = FILE.sub(lambda found: named(found, found[1]), part)
        if file == "docs/theory.md":  # its table of equations names files in mobman
            part = CELL.sub(lambda found: f"| {named(found, 'mobman/' + found[1])} |", part)
        return part

    parts, end = [], 0
    for fence in FENCE.finditer(text):
        parts += [prose(text[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, prose(text[end:])]), sources


def source_page(file: str) -> str:
    """A page with the content of a file."""
    language = LANGUAGES.get(Path(file).suffix, "text")
    text = (ROOT / file).read_text(encoding="utf-8")
    return f"---\norphan: true\n---\n\n# {file}\n\n````{language}\n{text}````\n"


def contents() -> str:
    """The navigation, as the front page holds it."""
    blocks = []
    for caption, titles in CONTENTS.items():
        entries = "\n".join(f"{title} <{page}>" for page, title in titles.items())
        blocks.append(f"```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{entries}\n```\n")
    return "\n" + "\n".join(blocks)


def write_pages(folder: Path) -> None:
    """Write the pages into a folder, for Sphinx.

    Raises:
        FileNotFoundError: If a link leads to no file.
    """
    folder.mkdir(parents=True)
    shutil.copytree(ROOT / "docs" / "images", folder / "images")
    files = [path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").glob("*.md"))]
    sources: set[str] = set()
    for file in [*files, *ELSEWHERE]:
        text, wanted = linked((ROOT / file).read_text(encoding="utf-8"), file)
        sources |= wanted
        if file == "README.md":
            text += contents()
        (folder / place(file)).write_text(text, encoding="utf-8")
    for file in sources:
        page = folder / place(file)
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(source_page(file), encoding="utf-8")
