#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Does what docs/how_to/install.md says of ROS 2 Jazzy with its real tools: test/jazzy.sh
#
# Builds this clone with colcon in a temporary workspace, starts nodes by ros2 run and ros2 launch in a ROS domain of its
# own on this machine alone, asks them by ros2, and ends all that it started. It takes some minutes; the first time it
# compiles the servo too.
#
# Needs a sourced ROS 2 Jazzy (apt), colcon, and what setup.py requires (docs/how_to/install.md).
# JAZZY_PATIENCE: seconds that it waits for each answer [120].
#
# Exit code 0: all is as the documents say; 1: a sentence names what was not; 77: a sentence names what is missing here.
set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
PATIENCE=${JAZZY_PATIENCE:-120}
TOOLS=(ros2 colcon python3 timeout)
# Of ROS, then of setup.py.
MODULES=(rclpy launch.actions launch_ros.actions ros2run ros2launch ros2lifecycle ros2param ros2service ros2topic ros2bag
  aiohttp fcl llvmlite matplotlib mcap numba numpy psutil pydantic pymunk rich rosbags scipy serial typer yaml zstandard)
GRAPH=(--no-daemon --spin-time 3) # the daemon of ros2 would outlive this script
WORK=""
STARTED=() # leaders of the process groups that are running

say() { echo "jazzy: $*"; }
fail() {
  echo "jazzy: $*${WORK:+; logs are in $WORK}" >&2
  exit 1
}

# missing: names what this machine lacks, one word each.
missing() {
  local name
  for name in "${TOOLS[@]}"; do command -v "$name" >/dev/null || echo "$name"; done
  [ "${ROS_DISTRO:-}" = jazzy ] || echo "ROS_DISTRO=jazzy"
  command -v python3 >/dev/null || return 0
  for name in "${MODULES[@]}"; do python3 -P -c "import $name" >/dev/null 2>&1 || echo "python3-module:$name"; done
}

# want WHAT PATTERN COMMAND...: runs the command until what it prints has the pattern.
want() {
  local what=$1 pattern=$2 said until=$((SECONDS + PATIENCE))
  shift 2
  while true; do
    said=$(timeout --foreground -k 5 "$PATIENCE" "$@" 2>&1) || true
    if grep -Eq -- "$pattern" <<<"$said"; then
      say "$what"
      return
    fi
    if ((SECONDS >= until)); then
      fail "$what: not so; '$*' did not print '$pattern' but '$(tail -n 3 <<<"$said" | tr '\n' ' ')'"
    fi
    sleep 1
  done
}

# start NAME COMMAND...: in the background, in a process group of its own, so that a Ctrl-C reaches all of it.
start() {
  local name=$1
  shift
  set -m # without it bash would start it deaf to Ctrl-C
  "$@" >"$WORK/$name.log" 2>&1 </dev/null &
  STARTED+=("$!")
  set +m
}

# gone PID: waits up to 30 s for the end of a process group.
gone() {
  local tries
  for ((tries = 0; tries < 300; tries++)); do
    kill -0 -- "-$1" 2>/dev/null || return 0
    sleep 0.1
  done
  return 1
}

# end_all: Ctrl-C to all that runs, the last one first, then what is harder; false if Ctrl-C was not enough.
end_all() {
  local index pid code=0
  for ((index = ${#STARTED[@]} - 1; index >= 0; index--)); do
    pid=${STARTED[index]}
    kill -INT -- "-$pid" 2>/dev/null || continue
    gone "$pid" && continue
    code=1
    kill -TERM -- "-$pid" 2>/dev/null || true
    gone "$pid" || kill -KILL -- "-$pid" 2>/dev/null || true
  done
  STARTED=()
  return "$code"
}

ended() { end_all || fail "$1: Ctrl-C did not end it within 30 s"; }

leave() {
  local code=$?
  trap - EXIT
  end_all || true
  if [ "$code" -eq 0 ] && [ -n "$WORK" ]; then rm -rf "$WORK"; fi
  exit "$code"
}

active() { # active NAMESPACE NODE...
  local node
  for node in "${@:2}"; do
    want "$1/$node is active" '^active \[3\]' ros2 lifecycle get "${GRAPH[@]}" "$1/$node"
  done
}

build() {
  (cd "$WORK" && colcon --log-base log build --base-paths "$ROOT" --packages-select haptic_display) \
    >"$WORK/colcon.log" 2>&1 || fail "colcon build failed: $(tail -n 3 "$WORK/colcon.log" | tr '\n' ' ')"
  set +u # what colcon writes reads variables that are not there
  # shellcheck disable=SC1091
  . "$WORK/install/local_setup.bash"
  set -u
  say "colcon built it"
}

tools() {
  local name
  for name in haptic haptic_driver haptic_loopback haptic_recorder haptic_simulation haptic_viewer; do
    want "ros2 run knows $name" "^haptic_display $name\$" ros2 pkg executables haptic_display
  done
  want "haptic runs by ros2 run" 'peg_in_hole' ros2 run haptic_display haptic scenes
  want "my_setup.yaml is an operating point" 'my_setup.yaml: ok' ros2 run haptic_display haptic check my_setup.yaml
  say "compiling, if this machine has not yet"
  ros2 run haptic_display haptic compile >"$WORK/compile.log" 2>&1 ||
    fail "haptic compile failed: $(tail -n 1 "$WORK/compile.log")"
  ros2 run haptic_display haptic demo --scene wall --out demo >"$WORK/demo.log" 2>&1 ||
    fail "haptic demo failed: $(tail -n 1 "$WORK/demo.log")"
  say "haptic demo did its job"
}

arguments() {
  local name
  for name in namespace parameters scene device enable loopback record view rviz autostart; do
    want "the launch file has the argument $name" "'$name':" \
      ros2 launch haptic_display haptic_display.launch.py --show-args
  done
  want "a boolean that is none is refused" 'record.*perhaps.*alid' \
    ros2 launch haptic_display haptic_display.launch.py record:=perhaps
  want "a scene that is none is refused" 'nowhere is neither a file nor a name' \
    ros2 launch haptic_display haptic_display.launch.py scene:=nowhere
}

launched() {
  local topic bag
  start launch ros2 launch haptic_display haptic_display.launch.py parameters:=my_setup.yaml scene:=wall record:=True
  active /haptic haptic_driver haptic_loopback haptic_simulation haptic_recorder
  for topic in /haptic/encoder /haptic/handle /haptic/tool /haptic/wrench /haptic/joint_states /haptic/robot_description /tf; do
    want "$topic is there" "^$topic\$" ros2 topic list "${GRAPH[@]}"
  done
  want "the parameter file is in force" '4000\.0' ros2 param get "${GRAPH[@]}" /haptic/haptic_driver servo.rate
  want "the scene is in force" 'wall\.yaml' ros2 param get "${GRAPH[@]}" /haptic/haptic_simulation scene
  want "the hand moves as the scene suggests" 'press_wall' ros2 param get "${GRAPH[@]}" /haptic/haptic_loopback motion.name
  want "the driver can be enabled" 'success=True' \
    ros2 service call /haptic/haptic_driver/enable std_srvs/srv/Trigger
  want "the force on the hand can be read" 'force:' \
    ros2 topic echo "${GRAPH[@]}" --once /haptic/wrench geometry_msgs/msg/WrenchStamped
  ended "the launch file"
  for bag in haptic_bags/*; do
    want "ros2 bag reads the recording" '/haptic/trace' ros2 bag info "$bag"
  done
}

node_by_node() {
  local node
  for node in haptic_loopback haptic_driver haptic_simulation; do
    start "$node" ros2 run haptic_display "$node" --ros-args -r __ns:=/haptic --params-file my_setup.yaml
  done
  active /haptic haptic_loopback haptic_driver haptic_simulation
  want "the driver can be enabled, node by node" 'success=True' \
    ros2 service call /haptic/haptic_driver/enable std_srvs/srv/Trigger
  ended "ros2 run"
}

by_hand() {
  start by_hand ros2 launch haptic_display haptic_display.launch.py autostart:=false
  want "autostart:=false leaves the nodes unconfigured" '^unconfigured \[1\]' \
    ros2 lifecycle get "${GRAPH[@]}" /haptic/haptic_driver
  want "ros2 lifecycle configures" 'successful' \
    ros2 lifecycle set "${GRAPH[@]}" /haptic/haptic_loopback configure
  ended "the launch file with autostart:=false"
  start by_launch ros2 launch haptic_display haptic_display.launch.py autostart:=launch
  active /haptic haptic_loopback haptic_driver haptic_simulation
  ended "the launch file with autostart:=launch"
}

examples() {
  start with_own_node ros2 launch haptic_display with_own_node.launch.py
  want "the example's own node hears the force" 'greatest force on the hand' cat "$WORK/with_own_node.log"
  ended "with_own_node.launch.py"
  start two_displays ros2 launch haptic_display two_displays.launch.py
  active /left haptic_loopback haptic_driver haptic_simulation
  active /right haptic_loopback haptic_driver haptic_simulation
  ended "two_displays.launch.py"
}

main() {
  local lacking
  lacking=$(missing | paste -sd ' ')
  if [ -n "$lacking" ]; then
    echo "jazzy: missing here: $lacking (docs/how_to/install.md says how to get it)" >&2
    exit 77
  fi
  WORK=$(mktemp -d "${TMPDIR:-/tmp}/haptic_jazzy.XXXXXX")
  trap leave EXIT
  trap 'exit 130' INT TERM HUP
  export ROS_DOMAIN_ID=$((RANDOM % 100 + 1)) ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_LOG_DIR=$WORK/log
  unset ROS_LOCALHOST_ONLY ROS_STATIC_PEERS
  sed '/auto_enable/d' "$ROOT/config/demo.yaml" >"$WORK/my_setup.yaml"
  cd "$WORK"
  build
  tools
  arguments
  launched
  node_by_node
  by_hand
  examples
  say "all is as the documents say"
}

main "$@"
