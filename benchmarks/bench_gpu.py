"""Time every pass on this machine's GPU, without Blender: `python3 benchmarks/bench_gpu.py [SNAPSHOT.npz ...]`.

Needs Python 3.11, numpy and moderngl, nothing else. Snapshots come from benchmarks/snapshots.py; without any, a hall
with 16 lights is made here. Where EGL has several GPUs, GLCONTEXT_DEVICE_INDEX chooses; the name printed is the one
that was used.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import checkout

from rebound.benchmarks import results
from rebound.benchmarks.gpu_report import lines, measure
from rebound.benchmarks.scaling import hall, hall_view
from rebound.benchmarks.studio import methods, resized
from rebound.scene.data import Scene, View
from rebound.scene.snapshot import load_snapshot

OUT = checkout.ROOT / "out" / "bench"


def main() -> None:
    """Measure every scene with every method, print as it goes, write JSON."""
    arguments = _arguments()
    runs, named = [], ""
    for name, scene, view in _scenes(arguments):
        for method in methods(estimators=arguments.estimators):
            run = measure(name, scene, view, method, viewport=not arguments.final, frames=arguments.frames)
            if run.device != named:
                named = run.device
                print(f"device: {named}")
            print("\n".join(lines(run)), flush=True)
            runs.append(run)
    results.write(Path(arguments.out), runs)
    print(f"written to {arguments.out}")


def _scenes(arguments: argparse.Namespace) -> Iterator[tuple[str, Scene, View]]:
    files = [Path(file) for file in arguments.snapshots]
    named = [(file.stem, *load_snapshot(file)) for file in files]
    if not files:
        named = [("hall of 16 lights", hall(lights=16, triangles=20_000, instances=200), hall_view((1920, 1080)))]
    for name, scene, view in named:
        yield name, scene, resized(view, *arguments.size) if arguments.size else view


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Time every pass on this machine's GPU, without Blender.")
    parser.add_argument("snapshots", nargs="*", metavar="SNAPSHOT.npz")
    parser.add_argument("--size", type=int, nargs=2, metavar=("W", "H"), help="instead of each snapshot's own")
    parser.add_argument("--frames", type=int, default=30, help="how many the medians are of")
    parser.add_argument("--final", action="store_true", help="settings of a final render; default: of a viewport")
    parser.add_argument("--estimators", action="store_true", help="also every estimator that is not a method's default")
    parser.add_argument("--out", default=str(OUT / "gpu.json"))
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
