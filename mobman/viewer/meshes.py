"""Meshes as surfaces to draw: read with their colours, and reduced to what can be seen of them."""

from __future__ import annotations

import base64
import importlib.util
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array, Index
from mobman.robots.urdf.meshes import MeshError, read_isolated, read_triangles

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0 to 1."""
MeshKey = tuple[Path, tuple[float, float, float]]
"""A file and the scale of its three axes; a negative one mirrors it."""

_COLOURED = {".dae", ".obj", ".gltf", ".glb", ".ply"}
_SAME = 1e-3  # Difference of bounds that should agree, of their size
_TEXTURE_PIXELS = 1024
_MOST_SEEN, _MOST_OTHERS = 2500, 500
"""Triangles of one mesh: of one that is drawn at once, and of collision geometry."""
_ALL_TRIANGLES = 50_000
"""Triangles of all meshes of a robot together; a page stays small, and plays without a graphics card."""
_FEWEST = 100


def packed(array: NDArray[Any], kind: str) -> dict[str, Any]:
    """Pack an array for JSON, compact and exact: base64 of its bytes, little endian, row by row.

    ``kind`` is ``"f8"``, ``"f4"``, ``"u1"`` or ``"u4"``: the page reads these.
    """
    plain = np.ascontiguousarray(array, dtype="<" + kind)
    data = base64.b64encode(plain.tobytes()).decode("ascii")
    return {"kind": kind, "shape": list(plain.shape), "data": data}


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles, in one colour, in a colour a vertex, or with a picture on them."""

    vertices: Array  # m, shape (V, 3)
    faces: Index  # Vertices of each triangle, anticlockwise from outside, shape (F, 3)
    colour: Colour | None = None  # The mesh's own colour; None if its file says nothing
    vertex_colours: NDArray[np.uint8] | None = None  # 0 to 255, shape (V, 3)
    uv: Array | None = None  # Each vertex's place on the picture, 0 to 1, shape (V, 2)
    texture: str | None = None  # The picture, as a data: address

    @property
    def points(self) -> Array:
        """Points that span it (m), shape (V, 3)."""
        return self.vertices

    def described(self) -> dict[str, Any]:
        """The surface for the page."""
        kinds = {"vertices": "f4", "faces": "u4", "uv": "f4", "vertex_colours": "u1"}
        arrays = {name: getattr(self, name) for name in kinds}
        found = {k: packed(array, kinds[k]) for k, array in arrays.items() if array is not None}
        return {"type": "mesh", "texture": self.texture, **found}


def installed(library: str) -> bool:
    """Tell whether what reads meshes' colours (trimesh) or what reduces them is installed."""
    return importlib.util.find_spec(library) is not None


def read_meshes(
    wanted: Mapping[MeshKey, bool],
) -> tuple[dict[MeshKey, list[Surface]], dict[MeshKey, str]]:
    """Read meshes, with whether they are drawn at once, in their colours: each with the triangles that
    can be seen of it, all with what a page carries; and the reasons why some cannot be read."""
    found, problems = {}, {}
    for key, seen in wanted.items():
        try:
            found[key] = read_mesh(*key, coloured=seen)
        except MeshError as error:
            problems[key] = str(error)
    totals = {key: sum(len(part.faces) for part in parts) for key, parts in found.items()}
    kept = {k: min(n, _MOST_SEEN if wanted[k] else _MOST_OTHERS) for k, n in totals.items()}
    share = min(1.0, _ALL_TRIANGLES / max(1, sum(kept.values())))
    for key, parts in found.items():
        keep = share * kept[key] / totals[key]
        found[key] = [reduced(p, max(_FEWEST, math.ceil(keep * len(p.faces)))) for p in parts]
    return found, problems


def read_mesh(
    path: Path, scale: tuple[float, float, float], *, coloured: bool = True
) -> list[Surface]:
    """Read the parts of a mesh, one for each of its materials.

    Pinocchio's reader gives the geometry. Colours, if wanted, come from trimesh, where it is installed
    and the format has any; where the format leaves open which way is up and what a unit is (Collada),
    the geometry is still placed as Pinocchio places it.

    Raises:
        MeshError: If it cannot be read, has no triangle, or one with a corner that is not there.
    """
    plain = Surface(*read_triangles(path))
    parts = [plain]
    if coloured and path.suffix.lower() in _COLOURED and installed("trimesh"):
        parts = [Surface(**own) for own in read_isolated(f"{__name__}:coloured_parts", path)]
    for part in (plain, *parts):
        if len(part.faces) and not 0 <= part.faces.min() <= part.faces.max() < len(part.vertices):
            raise MeshError(f"the mesh {path} has a triangle with a corner that is not there")
    if parts != [plain]:
        parts = _as_placed(parts, plain)
    parts = [part for part in map(_tidied, parts) if len(part.faces)]
    if not parts:
        raise MeshError(f"the mesh {path} has no triangles")
    turn = -1 if np.prod(scale) < 0.0 else 1
    return [replace(p, vertices=p.vertices * scale, faces=p.faces[:, ::turn]) for p in parts]


def reduced(surface: Surface, triangles: int) -> Surface:
    """Reduce a surface to about so many triangles, in one colour where it had several; it stays as it is
    where that is enough, or where fast-simplification is not installed."""
    if len(surface.faces) <= triangles or not installed("fast_simplification"):
        return surface
    import fast_simplification

    vertices, faces = _merged(surface.vertices, surface.faces)
    points, corners = fast_simplification.simplify(
        np.ascontiguousarray(vertices, dtype=np.float32),
        np.ascontiguousarray(faces, dtype=np.int32),
        1.0 - triangles / len(faces),
    )
    if not len(corners):
        return surface
    # a picture or many colours do not survive: the average does
    colour, colours = surface.colour, surface.vertex_colours
    if colour is None and colours is not None:
        colour = _average(colours)
    return Surface(np.asarray(points, dtype=float), np.asarray(corners, dtype=np.int64), colour)


def coloured_parts(path: str) -> list[dict[str, Any]]:
    """The fields of a mesh's surfaces with their colours, read in this process by trimesh; files that
    the mesh names are read in its own folder only."""
    import trimesh

    # vertices are not merged here: those with a place on a picture must stay apart
    scene = trimesh.load_scene(path, process=False)
    placed = [scene.graph[node][:2] for node in scene.graph.nodes_geometry]
    return [
        asdict(_part(scene.geometry[name].copy().apply_transform(transform)))
        for transform, name in placed
        if isinstance(scene.geometry[name], trimesh.Trimesh)
    ]


def _part(geometry: Any) -> Surface:
    part = Surface(np.array(geometry.vertices, float), np.array(geometry.faces, np.int64))
    visual = geometry.visual
    if visual.kind == "texture":
        material = visual.material
        if (colour := getattr(material, "main_color", None)) is not None:
            r, g, b, a = (float(value) / 255.0 for value in colour)
            # a material that cannot be seen is a mistake of units
            part = replace(part, colour=(r, g, b, a if a > 0.0 else 1.0))
        image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
        if image is not None and visual.uv is not None and len(visual.uv) == len(part.vertices):
            part = replace(part, uv=np.array(visual.uv), texture=_data(image))
    elif visual.kind in ("vertex", "face") and visual.defined:
        colours = np.array(visual.vertex_colors)[:, :3]
        if len(np.unique(colours, axis=0)) > 1:
            return replace(part, vertex_colours=colours)
        return replace(part, colour=_average(colours))
    return part


def _average(colours: NDArray[Any]) -> Colour:
    r, g, b = (float(value) / 255.0 for value in np.mean(colours, axis=0))
    return (r, g, b, 1.0)


def _data(image: Any) -> str:
    """A picture as an address that holds it."""
    picture = image.convert("RGB")
    picture.thumbnail((_TEXTURE_PIXELS, _TEXTURE_PIXELS))
    stream = io.BytesIO()
    picture.save(stream, format="JPEG", quality=85)
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def _as_placed(parts: list[Surface], plain: Surface) -> list[Surface]:
    """Parts turned and scaled to the bounds of a plain surface; that surface if they do not fit."""
    if not parts:
        return [plain]
    low, size = plain.vertices.min(axis=0), np.ptp(plain.vertices, axis=0)
    diagonal = float(np.linalg.norm(size))
    everything = np.vstack([part.vertices for part in parts])
    length = float(np.linalg.norm(np.ptp(everything, axis=0)))
    y_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    for turn in (np.eye(3), y_up, y_up.T):
        for factor in (1.0, diagonal / length if length > 0.0 else 1.0):
            vertices = factor * everything @ turn.T
            wrong = [vertices.min(axis=0) - low, np.ptp(vertices, axis=0) - size]
            if np.all(np.abs(wrong) <= _SAME * diagonal):
                return [replace(p, vertices=factor * p.vertices @ turn.T) for p in parts]
    return [plain]


def _tidied(surface: Surface) -> Surface:
    """A surface without triangles that have no area or no place; bare vertices are merged."""
    finite = np.all(np.isfinite(surface.vertices), axis=1)
    faces = surface.faces[np.all(finite[surface.faces], axis=1)]
    vertices = np.where(finite[:, None], surface.vertices, 0.0)
    if surface.uv is None and surface.vertex_colours is None:
        vertices, faces = _merged(vertices, faces)
    distinct = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
    return replace(surface, vertices=vertices, faces=faces[distinct])


def _merged(vertices: Array, faces: Index) -> tuple[Array, Index]:
    """Vertices at one place as one; those that no triangle has are dropped."""
    used, corners = np.unique(faces, return_inverse=True)
    points = vertices[used].astype(np.float32) + np.float32(0.0)  # no -0, which has other bytes
    keys = np.ascontiguousarray(points).view("V12").ravel()  # rows as bytes sort fast
    _, first, place = np.unique(keys, return_index=True, return_inverse=True)
    return vertices[used][first], place[corners].reshape(-1, 3)


def hollowed(box: Array, wells: Sequence[Array]) -> Surface:
    """The surface of a box without what lies in other boxes along the same axes, which may reach out of
    it, to infinity too; of each the lowest and the highest corner (m), shape (2, 3)."""
    cuts = [np.clip(well, *box) for well in wells]
    edges = [np.unique([box[:, axis], *(cut[:, axis] for cut in cuts)]) for axis in range(3)]
    middles = np.meshgrid(*(0.5 * (edge[1:] + edge[:-1]) for edge in edges), indexing="ij")
    centres = np.stack(middles, axis=-1)
    full = np.ones(centres.shape[:3], dtype=bool)
    for low, high in wells:
        full &= ~np.all((centres > low) & (centres < high), axis=-1)
    quads: list[Array] = []
    padded = np.pad(full, 1)
    for axis in range(3):
        for side in (0, 1):  # faces towards the lower cell and the upper one
            beyond = np.roll(padded, 1 - 2 * side, axis)[1:-1, 1:-1, 1:-1]
            cells = np.argwhere(full & ~beyond)
            turns = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])[:: 1 if side else -1]
            corners = np.empty((len(cells), 4, 3))
            corners[:, :, axis] = edges[axis][cells[:, [axis]] + side]
            for other, steps in zip(((axis + 1) % 3, (axis + 2) % 3), turns.T, strict=True):
                corners[:, :, other] = edges[other][cells[:, [other]] + steps]
            quads.append(corners)
    vertices = np.concatenate(quads).reshape(-1, 3)
    around = np.arange(len(vertices)).reshape(-1, 4)
    return Surface(vertices, np.concatenate([around[:, [0, 1, 2]], around[:, [0, 2, 3]]]))
