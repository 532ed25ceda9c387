"""A small mobile manipulator that is in order, for cases that break it in one place each."""

from __future__ import annotations

from pathlib import Path

URDF = """\
<?xml version="1.0"?>
<robot name="cart">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>

  <link name="base_link">
    <inertial>
      <origin xyz="0 0 0.15" rpy="0 0 0"/>
      <mass value="30"/>
      <inertia ixx="0.6" ixy="0" ixz="0" iyy="0.9" iyz="0" izz="1.3"/>
    </inertial>
    <visual>
      <origin xyz="0 0 0.15" rpy="0 0 0"/>
      <geometry><box size="0.6 0.4 0.2"/></geometry>
      <material name="grey"/>
    </visual>
    <collision>
      <origin xyz="0 0 0.15" rpy="0 0 0"/>
      <geometry><box size="0.6 0.4 0.2"/></geometry>
    </collision>
  </link>

  <link name="right_wheel">
    <inertial>
      <mass value="1.5"/>
      <inertia ixx="0.005" ixy="0" ixz="0" iyy="0.0075" iyz="0" izz="0.005"/>
    </inertial>
    <collision>
      <origin rpy="1.5707963267948966 0 0"/>
      <geometry><cylinder radius="0.1" length="0.04"/></geometry>
    </collision>
  </link>
  <joint name="right_wheel_joint" type="continuous">
    <parent link="base_link"/>
    <child link="right_wheel"/>
    <origin xyz="0 -0.22 0.1" rpy="0 0 0"/>
    <axis xyz="0 1 0"/>
    <limit effort="12" velocity="20"/>
  </joint>

  <link name="left_wheel">
    <inertial>
      <mass value="1.5"/>
      <inertia ixx="0.005" ixy="0" ixz="0" iyy="0.0075" iyz="0" izz="0.005"/>
    </inertial>
    <collision>
      <origin rpy="1.5707963267948966 0 0"/>
      <geometry><cylinder radius="0.1" length="0.04"/></geometry>
    </collision>
  </link>
  <joint name="left_wheel_joint" type="continuous">
    <parent link="base_link"/>
    <child link="left_wheel"/>
    <origin xyz="0 0.22 0.1" rpy="0 0 0"/>
    <axis xyz="0 1 0"/>
    <limit effort="12" velocity="20"/>
  </joint>

  <link name="caster">
    <collision><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <joint name="caster_joint" type="fixed">
    <parent link="base_link"/>
    <child link="caster"/>
    <origin xyz="-0.25 0 0.05"/>
  </joint>

  <link name="column">
    <inertial>
      <origin xyz="0 0 0.2"/>
      <mass value="4"/>
      <inertia ixx="0.06" ixy="0" ixz="0" iyy="0.06" iyz="0" izz="0.01"/>
    </inertial>
    <visual>
      <geometry><mesh filename="package://cart_description/meshes/column.stl"/></geometry>
    </visual>
    <collision>
      <geometry><mesh filename="package://cart_description/meshes/column.stl"/></geometry>
    </collision>
  </link>
  <joint name="lift" type="prismatic">
    <parent link="base_link"/>
    <child link="column"/>
    <origin xyz="0.1 0 0.25"/>
    <axis xyz="0 0 1"/>
    <limit lower="0" upper="0.4" effort="400" velocity="0.1"/>
    <dynamics damping="10" friction="1"/>
  </joint>

  <link name="upper_arm">
    <inertial>
      <origin xyz="0.2 0 0"/>
      <mass value="2"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="column"/>
    <child link="upper_arm"/>
    <origin xyz="0 0 0.4"/>
    <axis xyz="0 0 1"/>
    <limit lower="-2.5" upper="2.5" effort="60" velocity="2"/>
  </joint>

  <link name="forearm">
    <inertial>
      <origin xyz="0.15 0 0"/>
      <mass value="1.2"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
  </link>
  <joint name="elbow" type="revolute">
    <parent link="upper_arm"/>
    <child link="forearm"/>
    <origin xyz="0.4 0 0"/>
    <axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="40" velocity="2"/>
  </joint>

  <link name="right_finger">
    <inertial>
      <mass value="0.05"/>
      <inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/>
    </inertial>
  </link>
  <joint name="right_finger_joint" type="prismatic">
    <parent link="forearm"/>
    <child link="right_finger"/>
    <origin xyz="0.3 -0.02 0"/>
    <axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="10" velocity="0.1"/>
  </joint>

  <link name="left_finger">
    <inertial>
      <mass value="0.05"/>
      <inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/>
    </inertial>
  </link>
  <joint name="left_finger_joint" type="prismatic">
    <parent link="forearm"/>
    <child link="left_finger"/>
    <origin xyz="0.3 0.02 0"/>
    <axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="10" velocity="0.1"/>
    <mimic joint="right_finger_joint" multiplier="1" offset="0"/>
  </joint>

  <link name="tool"/>
  <joint name="tool_joint" type="fixed">
    <parent link="forearm"/>
    <child link="tool"/>
    <origin xyz="0.35 0 0"/>
  </joint>

  <gazebo reference="base_link"><sensor:camera name="no namespace is declared"/></gazebo>
  <transmission name="t"><type>SimpleTransmission</type><joint name="elbow"/></transmission>
</robot>
"""

TOML = """\
schema = 1
name = "cart"

[urdf]
path = "cart_description/urdf/cart.urdf"
lock = ["*_finger_joint"]

[platform]
type = "differential"
right_wheel = "right_wheel_joint"
left_wheel = "left_wheel_joint"
wheel_radius = 0.1

[arm]
tip = "tool"

[rest]
lift = 0.1
elbow = 0.6
"""

BOOM = """\
<robot name="boom">
  <link name="foot"/>
  <link name="boom">
    <inertial>
      <origin xyz="0.1 0 0"/>
      <mass value="0.5"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.002"/>
    </inertial>
  </link>
  <joint name="pan" type="revolute">
    <parent link="foot"/>
    <child link="boom"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="5" velocity="1"/>
  </joint>
</robot>
"""

MOUNT = """
[[mount]]
path = "boom.urdf"
prefix = "boom_"
parent = "base_link"
xyz = [-0.2, 0, 0.25]
"""

MESH = """\
solid column
  facet normal 0 0 1
    outer loop
      vertex 0 0 0
      vertex 0.1 0 0
      vertex 0 0.1 0
    endloop
  endfacet
endsolid column
"""


class GoodRobot:
    """The robot's files in a folder, and ways to change them.

    Attributes:
        urdf: Its URDF, in ``cart_description/urdf``; the mesh is in ``cart_description/meshes``.
        toml: Its description, in the folder itself.
        boom: The URDF of something that can be mounted on it, see :meth:`mount`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.urdf = folder / "cart_description" / "urdf" / "cart.urdf"
        self.mesh = folder / "cart_description" / "meshes" / "column.stl"
        self.toml = folder / "cart.toml"
        self.boom = folder / "boom.urdf"
        for file, text in (
            (self.urdf, URDF), (self.mesh, MESH), (self.toml, TOML), (self.boom, BOOM),
        ):  # fmt: skip
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")

    def change(self, file: Path, old: str, new: str) -> None:
        """Replace the one place where a file has ``old``."""
        text = file.read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{old!r} is there {text.count(old)} times"
        file.write_text(text.replace(old, new), encoding="utf-8")

    def change_urdf(self, old: str, new: str) -> None:
        """Replace the one place where the URDF has ``old``."""
        self.change(self.urdf, old, new)

    def change_toml(self, old: str, new: str) -> None:
        """Replace the one place where the description has ``old``."""
        self.change(self.toml, old, new)

    def add_to_urdf(self, elements: str) -> None:
        """Add elements at the URDF's end."""
        self.change_urdf("</robot>", f"{elements}\n</robot>")

    def mount(self) -> None:
        """Mount the boom."""
        self.toml.write_text(TOML + MOUNT, encoding="utf-8")
