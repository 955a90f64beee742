"""Precomputed radiance transfer: how each object passes the light of the environment on, found once and kept in a file.

Numpy and Embree, no Blender, no GPU: a worker process (``worker.py``) reads a snapshot of a scene and writes the file.
docs/prt.md has the formulas, the conventions and the measured errors.
"""
