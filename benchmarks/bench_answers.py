"""How long bakes take to answer a light: `OPENBLAS_NUM_THREADS=1 .venv/bin/python benchmarks/bench_answers.py`.

Seconds of one CPU core for 50,000 vertices of three channels, as when the world is turned: made-up numbers, real sizes.
"""

from __future__ import annotations

import time

import checkout  # noqa: F401  finds the package
import numpy as np

from rebound.bake.light import Surroundings
from rebound.bake.live import Live, make_live
from rebound.scene.data import Transfer

VERTICES, CLUSTERS, AXES, TIMES = 50_000, 64, 19, 7


def transfers(rng: np.random.Generator) -> dict[str, Transfer]:
    """A diffuse bake of five bands, and a glossy one of five to five as compressed to an error of 1 %."""
    settings = {"bounces": 1, "shadows": True}
    glossy = {
        "clusters": rng.integers(0, CLUSTERS, VERTICES).astype(np.uint32),
        "weights": rng.normal(size=(VERTICES, AXES)).astype(np.float16),
        "means": rng.normal(size=(CLUSTERS, 3 * 625)).astype(np.float16),
        "axes": rng.normal(size=(CLUSTERS, AXES, 3 * 625)).astype(np.float16),
    }
    about = {"kind": "GLOSSY", "matrix": (3, 25, 25), "rms": 0.0, "worst": 0.0, "settings": settings}
    vectors = {"diffuse": rng.normal(size=(VERTICES, 3, 25)).astype(np.float16)}
    return {
        "diffuse": Transfer("diffuse", {"kind": "DIFFUSE", "settings": settings}, vectors),
        "glossy": Transfer("glossy", about, glossy),
    }


def milliseconds(live: Live, light: Surroundings, rng: np.random.Generator) -> float:
    """The median over turns of the light."""
    times = []
    for _ in range(TIMES):
        frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        start = time.process_time()
        live.answer(light, frame, 6, 0.0, 256)
        times.append(time.process_time() - start)
    return 1e3 * float(np.median(times))


def main() -> None:
    rng = np.random.default_rng(0)
    light = Surroundings(rng.random((256, 256, 3)))
    light.harmonics(5)
    for name, transfer in transfers(rng).items():
        print(f"{name}: {milliseconds(make_live(transfer), light, rng):.0f} ms")


if __name__ == "__main__":
    main()
