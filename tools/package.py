"""Build and validate dist/rebound-<version>.zip with Blender's own extension builder.

`.venv/bin/python tools/package.py`. The wheels that blender_manifest.toml names are fetched into wheels/ first, each
against its hash in wheels.lock.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tomllib
from collections import defaultdict
from pathlib import Path

from environments import ROOT

WHEELS = ROOT / "wheels"
LOCK = ROOT / "wheels.lock"
DIST = ROOT / "dist"


def locked_hashes() -> dict[str, str]:
    """Wheel file name -> sha256, from wheels.lock (the format of sha256sum)."""
    lines = (line.split() for line in LOCK.read_text().splitlines() if line)
    return {name: digest for digest, name in lines}


def check_lists(manifest: dict, locked: dict[str, str]) -> None:
    """The manifest and the lock name the same wheels. Raises SystemExit."""
    listed = {Path(wheel).name for wheel in manifest["wheels"]}
    odd = sorted(listed ^ set(locked))
    if odd:
        raise SystemExit(f"package: only in one of blender_manifest.toml and wheels.lock: {', '.join(odd)}")


def is_fetched(name: str, digest: str) -> bool:
    """Whether the wheel lies in wheels/ with the right content."""
    file = WHEELS / name
    return file.exists() and hashlib.sha256(file.read_bytes()).hexdigest() == digest


def fetch(locked: dict[str, str]) -> None:
    """Fetch what is missing, one pip call for all wheels of one platform and Python; pip checks the hashes."""
    groups: dict[tuple[str, str], list[str]] = defaultdict(list)
    for name, digest in locked.items():
        if not is_fetched(name, digest):
            _, _, python, _, platform = name.removesuffix(".whl").split("-")
            groups[python, platform].append(name)
    WHEELS.mkdir(exist_ok=True)
    for (python, platform), names in groups.items():
        print(f"package: fetching {', '.join(names)}", flush=True)
        _fetch_group(python, platform, {name: locked[name] for name in names})
    missing = [name for name, digest in locked.items() if not is_fetched(name, digest)]
    if missing:
        raise SystemExit(f"package: pip did not deliver {', '.join(missing)}")


def _fetch_group(python: str, platform: str, wheels: dict[str, str]) -> None:
    pins = [f"{name.split('-')[0]}=={name.split('-')[1]} --hash=sha256:{digest}" for name, digest in wheels.items()]
    requirements = WHEELS / "requirements.txt"
    requirements.write_text("\n".join(pins))
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    command += ["--only-binary=:all:", "--implementation=cp", f"--python-version={python.removeprefix('cp')}"]
    command += [f"--platform={tag}" for tag in platform.split(".")]
    command += [f"--dest={WHEELS}", f"--requirement={requirements}"]
    try:
        if subprocess.run(command).returncode != 0:
            raise SystemExit(f"package: pip could not fetch {', '.join(wheels)}")
    finally:
        requirements.unlink()


def blender_extension_tool() -> Path:
    """The command line of Blender's extension add-on, inside the bpy wheel."""
    pattern = "lib/python*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
    return next(Path(sys.prefix).glob(pattern))


def build(manifest: dict) -> Path:
    """Build the zip and validate it. Raises SystemExit with Blender's own words."""
    DIST.mkdir(exist_ok=True)
    package = DIST / f"{manifest['id']}-{manifest['version']}.zip"
    package.unlink(missing_ok=True)
    tool = [sys.executable, str(blender_extension_tool())]
    for step in (["build", f"--source-dir={ROOT}", f"--output-filepath={package}"], ["validate", str(package)]):
        answer = subprocess.run([*tool, *step], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if answer.returncode != 0:
            raise SystemExit(f"{answer.stdout}\npackage: Blender's extension {step[0]} failed")
    return package


def main() -> None:
    """Fetch, build, validate."""
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    locked = locked_hashes()
    check_lists(manifest, locked)
    fetch(locked)
    package = build(manifest)
    print(f"package: {package.relative_to(ROOT)}, {package.stat().st_size / 1e6:.1f} MB, valid")


if __name__ == "__main__":
    main()
