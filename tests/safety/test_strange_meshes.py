"""Meshes of unknown origin: what crashes their reader costs the mesh, and they read nothing else."""

from __future__ import annotations

import json
import os
import struct
from dataclasses import asdict

import numpy as np
import pytest
from PIL import Image
from support.variants import toml, youbot_urdf, youbot_with_urdf

import mobman as mm
from mobman.isolation import Crash, Helper, helper
from mobman.robots.urdf.meshes import MeshError, read_triangles
from mobman.viewer import meshes
from mobman.viewer.meshes import Surface
from mobman.viewer.robot import robot_parts

PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 1 2
3 0 1 3
3 0 2 3
3 1 2 3
"""


def damaged(count, seed):
    random = np.random.default_rng(seed)
    for _ in range(count):
        content = bytearray(PLY.encode())
        for place in random.integers(len(content), size=3):
            content[place] ^= int(random.integers(1, 256))
        yield bytes(content)


def _with_mesh(folder, name):
    look = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    text = youbot_urdf().replace('<link name="arm_1">', f'<link name="arm_1">{look}')
    content = youbot_with_urdf(folder, text, name="mine")
    path = folder / "mine.toml"
    path.write_text(toml(content), encoding="utf-8")
    return path


def test_good_mesh(tmp_path):
    path = tmp_path / "good.ply"
    path.write_text(PLY, encoding="ascii")
    vertices, faces = read_triangles(path)
    assert vertices.shape == (4, 3)
    assert faces.tolist() == [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]


def _all_are_read_or_refused(tmp_path, count, seed):
    """Whatever the reader of a damaged mesh does, this process goes on, and the mesh is named."""
    refused = 0
    path = tmp_path / "damaged.ply"
    for content in damaged(count, seed):
        path.write_bytes(content)
        try:
            meshes.read_mesh(path, (1.0, 1.0, 1.0))
        except MeshError as error:
            refused += 1
            if str(path) not in str(error):
                raise
    assert refused > 0


def test_damaged_meshes_cost_the_mesh(tmp_path):
    _all_are_read_or_refused(tmp_path, 12, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 6))
def test_many_damaged_meshes(seed, tmp_path):
    _all_are_read_or_refused(tmp_path, 40, seed)


@pytest.fixture
def deadly(trap, monkeypatch):
    """A mesh that ends the process that reads it, whatever the reader's version makes of its bytes."""
    path = trap.folder / "deadly.ply"
    path.write_text(PLY, encoding="ascii")
    call = helper.call

    def calls(function, *arguments, **limits):
        dies = str(path) in map(str, arguments)
        return call("support.strange_readers:dies" if dies else function, *arguments, **limits)

    monkeypatch.setattr(helper, "call", calls)
    return path


def test_mesh_that_ends_its_reader_is_named_and_left_out(trap, mobman, deadly):
    folder = trap.folder
    with pytest.raises(MeshError, match=r"deadly\.ply: its reader was ended by signal 11"):
        read_triangles(deadly)
    robot = _with_mesh(folder, deadly.name)
    page = trap.folder.parent / "page.html"
    shown = mobman("view", robot, "--html", page)
    assert shown.status == 0
    assert "deadly.ply" in shown.err
    assert "1 meshes are not drawn" in shown.err
    assert page.stat().st_size > 0
    checked = mobman("robots", "check", robot, "--no-simulation")
    assert checked.status == 0, checked.err
    assert "deadly.ply" in checked.out.replace("\n", "").replace(" ", "")


@pytest.mark.parametrize("reader", ["read_triangles", "read_isolated"])
def test_triangle_with_a_corner_that_is_not_there(tmp_path, monkeypatch, reader):
    whole, broken = (Surface(np.eye(3), np.array([corners])) for corners in ([0, 1, 2], [0, 1, 7]))
    plain, own = (broken, whole) if reader == "read_triangles" else (whole, broken)
    monkeypatch.setattr(meshes, "read_triangles", lambda path: (plain.vertices, plain.faces))
    monkeypatch.setattr(meshes, "read_isolated", lambda function, path: [asdict(own)])
    monkeypatch.setattr(meshes, "installed", lambda library: True)
    with pytest.raises(MeshError, match=r"x\.obj has a triangle with a corner that is not there"):
        meshes.read_mesh(tmp_path / "x.obj", (1.0, 1.0, 1.0))


def test_pipe_for_a_mesh(trap):
    os.mkfifo(trap.folder / "pipe.stl")
    with pytest.raises(MeshError, match=r"pipe\.stl: it is no file"):
        read_triangles(trap.folder / "pipe.stl")


def _gltf(path, uri):
    """A triangle whose numbers are those of a file."""
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"uri": uri, "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 3,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [1, 1, 1],
            }
        ],
    }
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("uri", ["../secret.bin", "%2e%2e/secret.bin", "ABSOLUTE"])
def test_numbers_of_a_file_elsewhere_are_not_read(trap, uri):
    secret = trap.folder.parent / "secret.bin"
    numbers = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    secret.write_bytes(numbers)
    (trap.folder / "own.bin").write_bytes(numbers)
    assert len(read_triangles(_gltf(trap.folder / "good.gltf", "own.bin"))[0]) == 3
    path = _gltf(trap.folder / "bad.gltf", str(secret) if uri == "ABSOLUTE" else uri)
    with pytest.raises(MeshError, match=r"bad\.gltf: it takes numbers from .*, outside its own"):
        read_triangles(path)


def test_key_that_is_there_twice(trap):
    """Readers take the first or the last."""
    (trap.folder.parent / "secret.bin").write_bytes(bytes(36))
    path = _gltf(trap.folder / "twice.gltf", "own.bin")
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('"uri"', '"uri": "../secret.bin", "uri"'), encoding="utf-8")
    with pytest.raises(MeshError, match="a key of its JSON is there twice"):
        read_triangles(path)


def test_picture_elsewhere_is_not_drawn(trap):
    for folder in (trap.folder, trap.folder.parent):
        Image.new("RGB", (8, 8), (200, 30, 30)).save(folder / "picture.png")
    path = trap.folder / "mesh.obj"
    text = "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n"
    path.write_text(text + "f 1/1 2/2 3/3\n", encoding="utf-8")

    def textures(name):
        (trap.folder / "mesh.mtl").write_text(f"newmtl m\nmap_Kd {name}\n", encoding="utf-8")
        return [part.texture for part in meshes.read_mesh(path, (1.0, 1.0, 1.0)) if part.texture]

    assert len(textures("picture.png")) == 1
    (trap.folder / "picture.png").unlink()
    assert textures("../picture.png") == []
    assert textures(str(trap.folder.parent / "picture.png")) == []


def test_reader_is_stopped_in_time_and_memory():
    with pytest.raises(Crash, match=r"it takes more than 0\.3 s of processor time"):
        helper.call("support.strange_readers:endless", seconds=0.3, megabytes=100.0)
    with pytest.raises(Crash, match="it takes more than 100 MB of memory"):
        helper.call("support.strange_readers:greedy", seconds=5.0, megabytes=100.0)
    with pytest.raises(Crash, match="KeyError"):
        helper.call("support.strange_readers:raising", seconds=5.0, megabytes=100.0)
    value = {"a": [1, None, "x", b"bytes"], "b": np.arange(6.0).reshape(2, 3), "c": float("inf")}
    back = helper.call("support.strange_readers:same", 3, seconds=5.0, megabytes=100.0)
    assert repr(back) == repr(value)


@pytest.mark.parametrize("error", [["os", "system"], ["mobman.isolation", "serve"]])
def test_answer_of_a_reader_that_was_taken_over(trap, monkeypatch, harmless, error):
    answer = {"error": error, "message": trap.command}
    monkeypatch.setattr("mobman.isolation._receive", lambda stream: answer)
    reader = Helper()
    try:
        with pytest.raises(Crash, match="its reader answers with"):
            reader.call("support.strange_readers:same", 3, seconds=5.0, megabytes=100.0)
    finally:
        reader.close()
    harmless()


def test_body_is_drawn_without_the_mesh(trap, deadly):
    parts, warnings = robot_parts(mm.load_robot(_with_mesh(trap.folder, "deadly.ply")))
    assert len(warnings) == 1
    assert {part.role for part in parts} >= {"visual"}
