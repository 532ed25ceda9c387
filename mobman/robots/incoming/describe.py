"""A robot's description from what a user names: its URDFs, and what is inferred of them."""

from __future__ import annotations

import os
import re
import textwrap
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from glob import escape
from importlib.resources import files
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit

from mobman.errors import SpecError, UsageError
from mobman.robots.incoming.incoming import OnLink, UrdfPart, incoming
from mobman.robots.incoming.licence import comments_of, licence
from mobman.robots.infer.findings import Inferred, Options, Undecided
from mobman.robots.infer.infer import Inference, infer
from mobman.robots.spec import NAME, CriterionSource, Mount, RobotSpec, UrdfSource, own_robots
from mobman.robots.urdf.compose import Mounted, compose
from mobman.robots.urdf.meshes import mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.validate import listed
from mobman.toml_model import validate

_WIDTH = 100
_GENERIC = r"((robot|model|urdf|main|description)([_.-]|$))+"
"""File names that say nothing of the robot."""
_AUTHOR = r"author|copyright|\(c\)|©|export"
_QUOTED = 160  # characters of who wrote a URDF


class Described(NamedTuple):
    """A robot as it is found."""

    name: str  # a name for it
    parts: tuple[UrdfPart, ...]  # its URDFs: the platform's, then what is mounted
    found: Inference  # what was inferred of all of them together
    packages: tuple[Path, ...]  # folders that the user named for the meshes
    warnings: tuple[str, ...]  # what was done to get the files, and what of them has no effect

    def toml(self, sources: Sequence[UrdfSource], heading: Inferred | None = None) -> str:
        """The text of its TOML, with these tables for its parts and the weight of the heading."""
        import jinja2

        path, (first, *_) = self.parts[0].origin or self.parts[0].file.path, sources
        place = first.path if first.package is None else f"{first.package}, {first.path}"
        said = [f"{place}, robot {self.found.robot_name!r} of the URDF"]
        # the first of the comments that says who wrote it
        authors = (text for text in comments_of(path) if re.search(_AUTHOR, text, re.IGNORECASE))
        short = (text if len(text) <= _QUOTED else f"{text[: _QUOTED - 3]}..." for text in authors)
        about = {"path": path, "source": "; ".join([*said, *islice(short, 1)])}
        pairs = zip(self.parts, sources, strict=True)
        about |= {"tables": [_table(*pair, self.found) for pair in pairs], "licence": licence(path)}
        text = (files("mobman.robots.incoming") / "robot.toml.j2").read_text(encoding="utf-8")
        template = jinja2.Template(text, trim_blocks=True, undefined=jinja2.StrictUndefined)
        tools = {"beside": _beside, "comment": _comment, "field": _field, "toml": _toml}
        known = {**self._asdict(), **about, "heading": heading, "usual": CriterionSource()}
        return str(template.render(known, **tools))

    def spec(self) -> RobotSpec:
        """The description itself, its files where they are."""
        sources = [part.source(None, self.packages) for part in self.parts]
        content = tomllib.loads(self.toml(sources))
        where = f"{self.parts[0].file.named} as it is taken"
        return validate(RobotSpec, {**content, "folder": Path.cwd()}, where)


def describe(
    source: str | os.PathLike[str],
    options: Options | None = None,
    *,
    name: str | None = None,
    output: Path | None = None,
    up: str = "z",
    mounts: Sequence[OnLink] = (),
    packages: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
    made_of: str = "",
) -> Described:
    """Find out everything about a robot that its description needs.

    Args:
        source: As of :func:`incoming`, like ``packages``, ``arguments``, and the errors.
        options: Facts that the user gives; Undecided if one more is needed, with all that are.
        name: Its name, if the user gives one; ``output`` and the files suggest others.
        output: The TOML that is to be written.
        up: Axis of the root link that points up.
        mounts: What is to be mounted on it.
        made_of: What the user gave, if the source was made of that.
    """
    parts = []
    for mount in (None, *mounts):
        named = source if mount is None else mount.source
        part = incoming(named, packages=packages, arguments=arguments)
        origin, axis = made_of or part.file.made_of, up if mount is None else "z"
        parts.append(replace(part, file=replace(part.file, up=axis, made_of=origin), mount=mount))
    base = parts[0]
    inside = base.file.parse().get("name", "")
    chosen = choose_name(name, output, inside, base.origin or base.file.path)
    found = infer(base.file if len(parts) == 1 else _mounted(parts), options or Options())
    said = [text for part in parts for text in (*part.said, *part.file.remarks)]
    if stated := [name for part in parts for name in part.file.friction]:
        said.append(
            f"<dynamics> gives damping or friction to {len(stated)} joints ({listed(stated)}), which "
            "the equations leave out: the scenario 'urdf-friction' has them"
        )
    warnings = tuple(dict.fromkeys((*said, *found.warnings)))
    return Described(chosen, tuple(parts), found, tuple(packages), warnings)


def _mounted(parts: Sequence[UrdfPart]) -> UrdfFile:
    """One URDF of all parts, as the description will have them, its meshes by absolute paths."""
    trees, mounted = [], []
    for part in parts:
        tree = part.file.parse()
        mesh_paths(tree, part.file)
        for mesh in tree.findall("link/*/geometry/mesh[@path]"):
            mesh.set("filename", mesh.attrib["path"])
        trees.append(tree)
        if (on := part.mount) is not None:
            if on.link is None:
                links = ", ".join(link.get("name", "") for link in trees[0].findall("link"))
                raise Undecided(f"which link carries {on.source}? Give --on; links: {links}")
            place = {"path": str(part.file.path), "parent": on.link, "prefix": on.prefix}
            mount = validate(Mount, place, f"--mount {on.source}")
            mounted.append(Mounted(tree, mount, f"--mount {on.source}: field 'mount"))
    try:
        whole = compose(trees[0], mounted)
    except SpecError as error:
        raise Undecided(f"{error} (by --on, --prefix)") from error
    base = parts[0].file
    return UrdfFile(base.path, base.package_folders, ET.tostring(whole), made_of=base.made_of)


def choose_name(wanted: str | None, output: Path | None, inside: str, urdf: Path) -> str:
    """A name for a robot: the wanted one, or by the output file (None: in the catalogue), the URDF's
    file, unless that says nothing, or the name inside the URDF; UsageError if there is none."""
    if wanted is not None:
        if not re.fullmatch(NAME, wanted):
            allowed = "letters, digits, '_', '.' and '-', first a letter or digit"
            raise UsageError(f"--name {wanted!r}: allowed: {allowed}")
        return wanted
    generic = re.fullmatch(_GENERIC, urdf.stem.lower()) is not None
    of_files = (inside, urdf.stem) if generic else (urdf.stem, inside)
    for candidate in (output.stem if output is not None else "", *of_files):
        clean = re.sub(r"[^A-Za-z0-9_.-]+", "_", candidate).strip("_.-").lower()
        if re.fullmatch(NAME, clean):
            # many URDFs are those of robots that come with mobman
            return f"my_{clean}" if output is None and clean in own_robots() else clean
    raise UsageError(f"{urdf}: no name for the robot; give --name")


# The TOML ----------------------------------------------------------------------------------------------


def _table(
    part: UrdfPart, source: UrdfSource, found: Inference
) -> tuple[str, dict[str, Inferred], list[tuple[str, str]]]:
    """The table of a URDF: its header, its fields, and patterns of what is locked, with reasons."""
    fields = {
        "package": Inferred(source.package),
        "path": Inferred(source.path),
        "sha256": Inferred(source.sha256, "of the file, which is said if it changes"),
        "packages": Inferred(source.packages, "where package://NAME/... is"),
    }
    if source.up != "z":
        fields["up"] = Inferred(source.up, "the root link's axis that points up")
    header, prefix = "[urdf]", ""
    if isinstance(source, Mount):
        header, prefix = "[[mount]]", source.prefix
        fields |= {"parent": Inferred(source.parent, "as asked for"), "prefix": Inferred(prefix)}
    own = {joint.get("name", "") for joint in part.file.parse().findall("joint")}

    def of_part(joints: Sequence[str]) -> list[str]:
        names = (name.removeprefix(prefix) for name in joints)
        return [name for name in names if name in own]

    locks = [
        (pattern, "" if i else lock.why)
        for lock in found.locks
        for i, pattern in enumerate(patterns(of_part(lock.joints), of_part(found.joints)))
    ]
    return header, {key: fact for key, fact in fields.items() if fact.value}, locks


def _field(key: str, fact: Inferred) -> str:
    """A line with a value and, as a comment, its reason."""
    return f"{tomlkit.key(key).as_string()} = {_toml(fact.value)}{_beside(fact.why)}"


def _toml(value: Any) -> str:
    """A value in TOML; a dictionary in one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_toml(one)}' for key, one in value.items())}}}"
    text: str = tomlkit.item(value).as_string()
    return text


def _beside(why: str) -> str:
    return f" # {_clean(why)}" if why else ""


def _comment(*texts: str) -> str:
    """A text as lines of comments."""
    wrapper = textwrap.TextWrapper(_WIDTH - 2, break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in wrapper.wrap(_clean(" ".join(texts))))


def _clean(text: str) -> str:
    """A text that may stand in a comment: TOML allows no control characters there."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def patterns(wanted: Sequence[str], every: Iterable[str]) -> list[str]:
    """Patterns that match of every name exactly the wanted ones, in their order."""
    others = [name for name in every if name not in set(wanted)]
    left = list(dict.fromkeys(wanted))
    found: list[str] = []
    while left:
        best = max(
            (p for p in _candidates(left[0]) if not any(fnmatchcase(n, p) for n in others)),
            # of those that say the same the simplest kind, "hand_*", and the longest of that kind
            key=lambda p: (sum(fnmatchcase(n, p) for n in left), p.endswith("*"), len(p)),
            default="",
        )
        if sum(fnmatchcase(name, best) for name in left) < 2:
            best = escape(left[0])
        found.append(best)
        left = [name for name in left if not fnmatchcase(name, best)]
    return found


def _candidates(name: str) -> list[str]:
    """Patterns from the words of a name: how it begins, begins and ends, and ends."""
    ends = [match.end() for match in re.finditer(r"[_\-./ ]", name)]
    heads, tails = [name[:i] for i in ends], [name[i - 1 :] for i in ends]
    both = [(head, tail) for head in heads for tail in ("", *tails) if len(tail) < len(name)]
    both += [("", tail) for tail in tails]
    return [f"{escape(head)}*{escape(tail)}" for head, tail in both]
