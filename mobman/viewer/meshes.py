"""Reading meshes with their colours, and reducing them to what can be seen."""

from __future__ import annotations

import base64
import importlib.util
import io
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array, Index
from mobman.robots.urdf.meshes import MeshError, read_isolated, read_triangles
from mobman.viewer.shapes import Colour, Mesh

_COLOURED = {".dae", ".obj", ".gltf", ".glb", ".ply"}
_SAME = 1e-3
"""How far bounds that should agree may differ, of their size."""
_TEXTURE_PIXELS = 1024


def can_read_colours() -> bool:
    """Whether the library is installed that reads the meshes' own colours and pictures."""
    return importlib.util.find_spec("trimesh") is not None


def can_reduce() -> bool:
    """Whether the library is installed that reduces meshes."""
    return importlib.util.find_spec("fast_simplification") is not None


def read_mesh(
    path: Path, scale: tuple[float, float, float], *, coloured: bool = True
) -> list[Mesh]:
    """The parts of a mesh, one for each of its materials.

    Pinocchio's reader gives the geometry. Colours come from trimesh, where it is installed and the
    format has any; where the format leaves open which way is up and what a unit is (Collada), the
    geometry is still placed as Pinocchio places it.

    Args:
        path: The file.
        scale: Of its three axes; a negative one mirrors it.
        coloured: Whether its own colours are wanted.

    Raises:
        MeshError: If it cannot be read, or has no triangle.
    """
    plain = Mesh(*read_triangles(path))
    _check(plain, path)
    parts = [plain]
    if coloured and path.suffix.lower() in _COLOURED and can_read_colours():
        parts = [_as_mesh(part) for part in read_isolated(f"{__name__}:coloured_parts", path)]
        for part in parts:
            _check(part, path)
        parts = _as_placed(parts, plain)
    parts = [part for part in (_tidied(part) for part in parts) if len(part.faces)]
    if not parts:
        raise MeshError(f"the mesh {path} has no triangles")
    return [_scaled(part, np.array(scale)) for part in parts]


def _as_mesh(part: dict[str, Any]) -> Mesh:
    colour = part["colour"]
    return Mesh(**{**part, "colour": None if colour is None else tuple(colour)})


def _check(mesh: Mesh, path: Path) -> None:
    """
    Raises:
        MeshError: If a triangle has a corner that is not there.
    """
    if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise MeshError(f"the mesh {path} has a triangle with a corner that is not there")


def reduced(mesh: Mesh, triangles: int) -> Mesh:
    """The mesh with at most about so many triangles, in one colour where it had several.

    It is returned as it is where that is enough, or where fast-simplification is not installed.
    """
    if len(mesh.faces) <= triangles or not can_reduce():
        return mesh
    import fast_simplification

    vertices, faces = _merged(mesh.vertices, mesh.faces)
    points, corners = fast_simplification.simplify(
        np.ascontiguousarray(vertices, dtype=np.float32),
        np.ascontiguousarray(faces, dtype=np.int32),
        1.0 - triangles / len(faces),
    )
    if not len(corners):
        return mesh
    # a picture or many colours do not survive: the average does
    colour = mesh.colour if mesh.colour is not None else _average(mesh.vertex_colours)
    return Mesh(np.asarray(points, dtype=float), np.asarray(corners, dtype=np.int64), colour=colour)


def coloured_parts(path: str) -> list[dict[str, Any]]:
    """The fields of the parts of a mesh with their colours, read in this process by trimesh; files that
    the mesh names are read in its own folder only."""
    import trimesh

    # vertices are not merged here: those with a place on a picture must stay apart
    scene = trimesh.load_scene(path, process=False)
    parts = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh):
            part = _part(geometry.copy().apply_transform(transform))
            parts.append({field.name: getattr(part, field.name) for field in fields(part)})
    return parts


def _part(geometry: Any) -> Mesh:
    vertices = np.array(geometry.vertices, dtype=float)
    faces = np.array(geometry.faces, dtype=np.int64)
    visual = geometry.visual
    if visual.kind == "texture":
        material = visual.material
        image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
        if image is not None and visual.uv is not None and len(visual.uv) == len(vertices):
            return Mesh(
                vertices, faces, _colour_of(material), uv=np.array(visual.uv), texture=_data(image)
            )
        return Mesh(vertices, faces, _colour_of(material))
    if visual.kind in ("vertex", "face") and visual.defined:
        colours = np.array(visual.vertex_colors)[:, :3]
        if len(np.unique(colours, axis=0)) == 1:
            return Mesh(vertices, faces, _average(colours))
        return Mesh(vertices, faces, vertex_colours=colours)
    return Mesh(vertices, faces)


def _colour_of(material: Any) -> Colour | None:
    found = getattr(material, "main_color", None)
    if found is None:
        return None
    r, g, b, a = (float(value) / 255.0 for value in found)
    return (r, g, b, a if a > 0.0 else 1.0)  # a material that cannot be seen is a mistake of units


def _average(colours: NDArray[Any] | None) -> Colour | None:
    if colours is None:
        return None
    r, g, b = (float(value) / 255.0 for value in np.mean(colours, axis=0))
    return (r, g, b, 1.0)


def _data(image: Any) -> str:
    """A picture as an address that holds it."""
    picture = image.convert("RGB")
    picture.thumbnail((_TEXTURE_PIXELS, _TEXTURE_PIXELS))
    stream = io.BytesIO()
    picture.save(stream, format="JPEG", quality=85)
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def _as_placed(parts: list[Mesh], plain: Mesh) -> list[Mesh]:
    """Parts turned and scaled to the bounds of a plain mesh; that mesh if they do not fit."""
    if not parts:
        return [plain]
    target = plain.bounds()
    size = float(np.linalg.norm(target[1] - target[0]))
    everything = np.vstack([part.vertices for part in parts])
    length = float(np.linalg.norm(np.ptp(everything, axis=0)))
    scale = size / length if length > 0.0 else 1.0
    for turn in (np.eye(3), _Y_UP, _Y_UP.T):
        for factor in (1.0, scale):
            vertices = factor * everything @ turn.T
            bounds = np.array([vertices.min(axis=0), vertices.max(axis=0)])
            if np.all(np.abs(bounds - target) <= _SAME * size):
                return [replace(p, vertices=factor * p.vertices @ turn.T) for p in parts]
    return [plain]


_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def _tidied(mesh: Mesh) -> Mesh:
    """Without triangles that have no area or no place; vertices merged where nothing is on them."""
    finite = np.all(np.isfinite(mesh.vertices), axis=1)
    faces = mesh.faces[np.all(finite[mesh.faces], axis=1)]
    vertices = np.where(finite[:, None], mesh.vertices, 0.0)
    if mesh.uv is None and mesh.vertex_colours is None:
        vertices, faces = _merged(vertices, faces)
    distinct = (
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    )
    return replace(mesh, vertices=vertices, faces=faces[distinct])


def _merged(vertices: Array, faces: Index) -> tuple[Array, Index]:
    """Vertices at one place as one; those that no triangle has are dropped."""
    if not len(faces):
        return vertices, faces
    used, corners = np.unique(faces, return_inverse=True)
    points = vertices[used].astype(np.float32) + np.float32(0.0)  # no -0, which has other bytes
    keys = np.ascontiguousarray(points).view("V12").ravel()  # rows as bytes sort fast
    _, first, place = np.unique(keys, return_index=True, return_inverse=True)
    return vertices[used][first], place[corners].reshape(-1, 3)


def _scaled(mesh: Mesh, scale: Array) -> Mesh:
    faces = mesh.faces[:, ::-1] if np.prod(scale) < 0.0 else mesh.faces
    return replace(mesh, vertices=mesh.vertices * scale, faces=faces)
