"""Save scenes for machines without Blender: `.venv/bin/python benchmarks/snapshots.py SCENE.blend ... [--out DIR]`.

Each becomes DIR/<name>.npz with its active camera's view at its own resolution, as benchmarks/bench_gpu.py reads it.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import checkout

from rebound.benchmarks.jobs import Job, do

OUT = checkout.ROOT / "out" / "bench" / "snapshots"


def main() -> None:
    """Convert every file in a Blender of its own."""
    parser = argparse.ArgumentParser(description="Save scenes for machines without Blender.")
    parser.add_argument("blends", nargs="+", metavar="SCENE.blend")
    parser.add_argument("--size", type=int, nargs=2, metavar=("W", "H"), help="instead of each file's own")
    parser.add_argument("--out", default=str(OUT))
    arguments = parser.parse_args()
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    for blend in map(Path, arguments.blends):
        if not blend.exists():
            raise SystemExit(f"snapshots: no file {blend}")
        size = (arguments.size[0], arguments.size[1]) if arguments.size else None
        with tempfile.TemporaryDirectory() as kept:
            done = do([Job(str(blend.resolve()), size=size)], Path(kept))[0]
            target = folder / f"{blend.stem}.npz"
            shutil.move(done.file, target)
        print(f"{target}, {target.stat().st_size / 1e6:.1f} MB, read in {done.seconds:.2f} s", flush=True)


if __name__ == "__main__":
    sys.exit(main())
