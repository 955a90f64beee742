#!/bin/sh
# Run a scenario in a real Blender window on a virtual screen, and print what it says.
#
#   tests/window/run_in_window.sh TREE SCENARIO.py OUT [blender arguments, e.g. --gpu-backend vulkan]
#
# TREE is the root of a Debian system with Blender, Xvfb and imagemagick in it ("/" where this one has them):
#   debootstrap --variant=minbase sid TREE
#   mount --bind /proc TREE/proc; mount --rbind /dev TREE/dev
#   chroot TREE apt-get install --no-install-recommends blender xvfb xdotool imagemagick libgl1-mesa-dri libegl1 \
#       libegl-mesa0 libglx-mesa0 libopengl0 mesa-vulkan-drivers python3-numpy python3-cattr python3-requests
# OUT is a folder for the screenshots. Exit status 0: Blender ended well, the scenario printed PASSED, and Blender
# printed no traceback but those that the scenario announced.
set -eu
tree=$1 scenario=$(realpath "$2") out=$(realpath -m "$3")
shift 3
root=$(realpath "$(dirname "$0")/../..")
work=$(mktemp -d -p "$tree/tmp" rebound-window.XXXXXX)
trap 'rm -rf "$work"' EXIT
inside=${work#"${tree%/}"}

# The package under its own name, without what only the repository needs.
mkdir "$work/rebound" "$work/out"
for entry in "$root"/*; do
    case $(basename "$entry") in
    dist | docs | out | tests | tools | wheels) ;;
    *) cp -r "$entry" "$work/rebound/" ;;
    esac
done
cp "$root/tests/window/steps.py" "$scenario" "$work/"

enter() { if [ "$tree" = / ]; then "$@"; else chroot "$tree" "$@"; fi; }
display=:$((20 + $$ % 200))
enter Xvfb "$display" -screen 0 1280x800x24 +extension GLX >/dev/null 2>&1 &
xvfb=$!
trap 'kill $xvfb 2>/dev/null; rm -rf "$work"' EXIT
sleep 1
status=0
enter env HOME="$inside" DISPLAY="$display" PYTHONPATH="$inside" WINDOW_OUT="$inside/out" timeout 500 \
    blender --factory-startup --python-use-system-env --window-geometry 0 0 1280 800 "$@" \
    --python "$inside/$(basename "$scenario")" >"$work/log" 2>&1 || status=$?
mkdir -p "$out"
cp "$work/out/"* "$out/" 2>/dev/null || true
cp "$work/log" "$out/log.txt"
grep -E '^(>>|rebound:|Traceback|[A-Za-z]*Error)' "$work/log" || true
tracebacks=$(grep -c '^Traceback' "$work/log" || true)
expected=$(grep -c '^>> a traceback is expected' "$work/log" || true)
if [ "$status" != 0 ] || ! grep -q '^>> PASSED' "$work/log" || [ "$tracebacks" != "$expected" ]; then
    echo "run_in_window: failed with status $status; the whole log is $out/log.txt" >&2
    exit 1
fi
