"""Where the meshes of a URDF are found, and what is said of those that are not."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import mobman as mm
from mobman.errors import SpecError
from mobman.model.build import load_geometry
from mobman.robots.urdf.meshes import MeshReference, absolute_meshes, mesh_paths
from mobman.robots.urdf.read import UrdfFile, share_folders

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def file(path: Path) -> Path:
    """A mesh there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(TRIANGLE, encoding="utf-8")
    return path


def urdf(folder: Path, *filenames: str, packages: tuple[Path, ...] = ()) -> UrdfFile:
    """A URDF in a folder, with a link for every mesh."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "robot.urdf"
    shape = '<{0}><geometry><mesh filename="{1}" scale="1 1 1"/></geometry></{0}>'
    links = [
        f'<link name="link_{i}">{shape.format("visual", name)}{shape.format("collision", name)}</link>'
        for i, name in enumerate(filenames)
    ]
    joints = [
        f'<joint name="joint_{i}" type="fixed"><parent link="link_0"/><child link="link_{i}"/></joint>'
        for i in range(1, len(filenames))
    ]
    path.write_text(f'<robot name="r">{"".join(links + joints)}</robot>', encoding="utf-8")
    return UrdfFile(path, packages)


def located(source: UrdfFile) -> list[Path | None]:
    """The paths of the visual meshes."""
    return [mesh.path for mesh in mesh_paths(source.parse(), source) if mesh.use == "visual"]


def refusal(source: UrdfFile) -> str:
    with pytest.raises(SpecError) as caught:
        absolute_meshes(source.parse(), source)
    return str(caught.value)


@pytest.fixture(autouse=True)
def no_ros(monkeypatch):
    """The environment of whoever runs the tests does not count."""
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)


def test_every_mesh_gets_its_absolute_path(tmp_path):
    mesh = file(tmp_path / "arm" / "meshes" / "a.obj")
    source = urdf(tmp_path / "arm" / "urdf", "package://arm/meshes/a.obj", "../meshes/a.obj")
    robot = source.parse()
    absolute_meshes(robot, source)
    assert [element.get("filename") for element in robot.iter("mesh")] == [str(mesh)] * 4
    assert {element.get("scale") for element in robot.iter("mesh")} == {"1 1 1"}


def test_meshes_of_an_installed_data_package(tmp_path):
    """Of a URDF that was copied out of it, which names them as it does there."""
    share = next(folder for folder in share_folders() if (folder / "example-robot-data").is_dir())
    robots = share / "example-robot-data" / "robots"
    original = robots / "tiago_description" / "robots" / "tiago_no_hand.urdf"
    copy = tmp_path / "copy.urdf"
    copy.write_bytes(original.read_bytes())
    source = UrdfFile(copy, ())
    found = located(source)
    assert len(found) > 10
    assert all(path.is_relative_to(robots.resolve()) for path in found)
    inside = UrdfFile(copy, (), within=(tmp_path,))  # as the URDF of a record
    assert located(inside) == found


def test_each_mesh_is_told_with_its_link_and_use(tmp_path):
    mesh = file(tmp_path / "a.obj")
    source = urdf(tmp_path, "a.obj", "b.obj")
    assert mesh_paths(source.parse(), source) == [
        MeshReference("link_0", "visual", "a.obj", mesh, ""),
        MeshReference("link_0", "collision", "a.obj", mesh, ""),
        MeshReference("link_1", "visual", "b.obj", None, "is not there"),
        MeshReference("link_1", "collision", "b.obj", None, "is not there"),
    ]


def test_telling_where_meshes_are_adds_that_alone(tmp_path):
    source = urdf(tmp_path, "a.obj")
    robot = source.parse()
    before = ET.tostring(robot)
    mesh_paths(robot, source)
    (added,) = {mesh.attrib.pop("problem") for mesh in robot.iter("mesh")}
    assert added.startswith("is not there")
    assert ET.tostring(robot) == before


@pytest.mark.parametrize(
    "name",
    [
        "package://arm/meshes/a.obj",
        "package:///arm/meshes/a.obj",
        "package://arm//meshes/./x/../a.obj",
        "model://arm/meshes/a.obj",
        "$(find arm)/meshes/a.obj",
        "file://$(find arm)/meshes/a.obj",
        "PACKAGE://arm/meshes/a.obj",
        " package://arm/meshes/a.obj ",
        "../meshes/a.obj",
        "meshes/a.obj",
        "arm/meshes/a.obj",
        "file://../meshes/a.obj",
    ],
)
def test_ways_to_name_a_mesh(tmp_path, name):
    mesh = file(tmp_path / "arm" / "meshes" / "a.obj")
    (tmp_path / "arm" / "meshes" / "x").mkdir()
    assert located(urdf(tmp_path / "arm" / "urdf", name)) == [mesh]


def test_absolute_paths(tmp_path):
    mesh = file(tmp_path / "with space" / "a.obj")
    quoted = str(mesh).replace(" ", "%20")
    source = urdf(tmp_path / "elsewhere", str(mesh), f"file://{mesh}", f"file://{quoted}")
    assert located(source) == [mesh] * 3


def test_folders_that_the_description_names_come_first(tmp_path):
    file(tmp_path / "robot" / "arm" / "a.obj")
    mine = file(tmp_path / "mine" / "arm" / "a.obj")
    source = urdf(tmp_path / "robot", "package://arm/a.obj", packages=(tmp_path / "mine",))
    assert located(source) == [mine]


def test_a_folder_that_the_description_names_may_be_the_package(tmp_path):
    mesh = file(tmp_path / "mine" / "arm" / "a.obj")
    source = urdf(tmp_path / "robot", "package://arm/a.obj", packages=(tmp_path / "mine" / "arm",))
    assert located(source) == [mesh]


def test_a_package_may_have_another_name_than_its_folder(tmp_path):
    """As that of a repository has, when it was downloaded."""
    mesh = file(tmp_path / "arm-main" / "meshes" / "a.obj")
    manifest = tmp_path / "arm-main" / "package.xml"
    manifest.write_text("<package><name>\n arm </name></package>", encoding="utf-8")
    assert located(urdf(tmp_path / "arm-main" / "urdf", "package://arm/meshes/a.obj")) == [mesh]
    manifest.write_text("<package><name>leg</name></package>", encoding="utf-8")
    assert located(urdf(tmp_path / "arm-main" / "urdf", "package://arm/meshes/a.obj")) == [None]


def test_packages_beside_the_urdfs(tmp_path):
    mesh = file(tmp_path / "src" / "gripper" / "meshes" / "a.obj")
    source = urdf(tmp_path / "src" / "arm" / "urdf", "package://gripper/meshes/a.obj")
    assert located(source) == [mesh]


def test_a_mesh_is_taken_from_the_folder_that_has_it(tmp_path):
    """A package may lie in two places, as after building it."""
    mesh = file(tmp_path / "built" / "arm" / "a.obj")
    (tmp_path / "src" / "arm").mkdir(parents=True)
    packages = (tmp_path / "src", tmp_path / "built")
    assert located(urdf(tmp_path / "r", "package://arm/a.obj", packages=packages)) == [mesh]


@pytest.mark.parametrize("place", ["arm", "stack/arm"])
def test_packages_of_ros_1(tmp_path, monkeypatch, place):
    mesh = file(tmp_path / "ws" / "src" / place / "a.obj")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path / 'ws' / 'src'}:")
    assert located(urdf(tmp_path / "robot", "package://arm/a.obj")) == [mesh]


def test_packages_of_ros_2(tmp_path, monkeypatch):
    mesh = file(tmp_path / "install" / "arm" / "share" / "arm" / "a.obj")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'install' / 'arm'}")
    assert located(urdf(tmp_path / "robot", "package://arm/a.obj")) == [mesh]


def test_links_to_meshes_keep_their_own_names(tmp_path):
    """Installations link to the sources, and stores of large files to names without a format."""
    file(tmp_path / "store" / "f00d")
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "a.obj").symlink_to(tmp_path / "store" / "f00d")
    assert located(urdf(tmp_path / "arm", "package://arm/a.obj")) == [tmp_path / "arm" / "a.obj"]


OUTSIDE = [
    "package://arm/../secret.obj",
    "package://arm/meshes/../../secret.obj",
    "package://arm/%2e%2e/secret.obj",
    "$(find arm)/../secret.obj",
    "model://arm/../secret.obj",
]


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_mesh_outside_its_package_is_refused(tmp_path, name):
    file(tmp_path / "secret.obj")
    source = urdf(tmp_path / "arm", name)
    assert located(source) == [None]
    assert f"{name!r} (link 'link_0', visual) leads outside its package 'arm'" in refusal(source)


@pytest.mark.parametrize("name", ["package://../secret.obj", "package://./secret.obj"])
def test_a_folder_above_is_no_package(tmp_path, name):
    file(tmp_path / "secret.obj")
    assert located(urdf(tmp_path / "arm", name)) == [None]


@pytest.mark.parametrize("name", ["package://", "package://arm", "package://arm/"])
def test_a_package_alone_is_no_mesh(tmp_path, name):
    assert "allowed: package://NAME/FILE" in refusal(urdf(tmp_path / "arm", name))


def test_missing_meshes_are_told_at_once(tmp_path):
    file(tmp_path / "a.obj")
    names = [f"package://arm/meshes/{i}.obj" for i in range(8)]
    source = urdf(tmp_path, "a.obj", *names, packages=(tmp_path / "mine",))
    said = refusal(source)
    for part in (
        "robot.urdf", "8 of 9 meshes", names[0], names[4], "'link_1'", "visual", "... and 3 more",
        "no package 'arm'", str(tmp_path / "mine"), "'urdf.packages'",
    ):  # fmt: skip
        assert part in said
    assert names[5] not in said
    assert "\n" not in said


def test_a_package_that_lacks_the_mesh_is_told(tmp_path):
    said = refusal(urdf(tmp_path / "arm" / "urdf", "package://arm/meshes/a.obj"))
    assert f"is missing in {tmp_path / 'arm'}" in said


def test_what_is_wrong_leaves_the_element_as_it_is(tmp_path):
    file(tmp_path / "a.obj")
    source = urdf(tmp_path, "a.obj", "b.obj")
    robot = source.parse()
    with pytest.raises(SpecError):
        absolute_meshes(robot, source)
    assert [element.get("filename") for element in robot.iter("mesh")][::2] == ["a.obj", "b.obj"]


@pytest.mark.parametrize("name", ["a.step", "a.mesh", "a"])
def test_formats_that_are_not_read_are_told(tmp_path, name):
    file(tmp_path / name)
    said = refusal(urdf(tmp_path, name))
    assert "not read" in said
    assert ".stl, .dae, .obj" in said


@pytest.mark.parametrize("name", ["a.OBJ", "a.obj"])
def test_formats_may_be_in_capitals(tmp_path, name):
    assert located(urdf(tmp_path, name)) == [None]
    file(tmp_path / name)
    assert located(urdf(tmp_path, name)) == [tmp_path / name]


@pytest.mark.parametrize("name", ["http://localhost:1/a.obj", "ftp://a.obj", "data://a.obj"])
def test_meshes_elsewhere_are_not_fetched(tmp_path, name):
    assert "allowed: package://, model://, file://, a path" in refusal(urdf(tmp_path, name))


@pytest.mark.parametrize(
    "name", ["x" * 5000 + ".obj", "package://arm/" + "x" * 5000 + ".obj", "a%00.obj"]
)
def test_names_that_no_file_can_have(tmp_path, name):
    assert located(urdf(tmp_path / "arm", name)) == [None]


def test_a_folder_is_no_mesh(tmp_path):
    (tmp_path / "a.obj").mkdir()
    assert located(urdf(tmp_path, "a.obj")) == [None]


@pytest.mark.parametrize("name", ["tiago_no_hand", "tiago_dual"])
def test_the_data_package_has_all_its_meshes(name):
    (source,) = mm.load_robot(name).urdf.files
    meshes = mesh_paths(source.parse(), source)
    assert len(meshes) > 30
    assert all(mesh.path is not None and mesh.path.is_file() for mesh in meshes)


def test_geometry_is_loaded_from_where_the_meshes_are(tiago, capfd):
    geometry = load_geometry(tiago)
    shapes = ("BOX", "CYLINDER", "SPHERE")
    paths = [Path(part.meshPath) for part in geometry.visual.geometryObjects]
    paths = [path for path in paths if path.name not in shapes]
    assert len(paths) > 10
    assert all(path.is_absolute() and path.is_file() for path in paths)
    assert capfd.readouterr().err == ""
