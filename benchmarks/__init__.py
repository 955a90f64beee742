"""What measures Rebound: never part of the extension, and never imported by it. docs/benchmarks.md says how to use it.

Scripts are bench.py, bench_gpu.py, snapshots.py and blender_worker.py; the rest are their modules. Data flows one way:
measuring writes JSON to out/bench, from which tables, plots and pages are made.
"""
