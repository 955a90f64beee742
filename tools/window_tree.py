"""Where a Blender with a window can run: on this machine itself, or in a Debian tree of our own.

A machine with Blender 4.5 or newer, Xvfb, xdotool and imagemagick is used as it is. Elsewhere Debian's current Blender
is unpacked by debootstrap into .cache/window/tree, once (two minutes, 1.8 GB), with this machine's mirror, proxy and
name servers. It is entered by chroot with mounts of its own, that vanish with the process: removing .cache is always
safe.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import system_libraries
from environments import ROOT

CACHE = ROOT / ".cache" / "window"
TREE = CACHE / "tree"
SUITE = "sid"  # the only one whose Blender is new enough
PACKAGES = (
    *("blender", "xvfb", "xdotool", "imagemagick", "python3-numpy", "python3-cattr", "python3-requests"),
    *("libgl1-mesa-dri", "libegl1", "libegl-mesa0", "libglx-mesa0", "libopengl0", "mesa-vulkan-drivers"),
)
OLDEST = (4, 5)
_WANTED = "Blender 4.5 or newer, Xvfb, xdotool and imagemagick"
_MADE = "rebound-made.txt"  # in a tree that is complete: the packages that were asked for
_SHARE = "/mnt"  # where a tree sees CACHE
_ENTER = (
    'tree=$1 share=$2; shift 2; mount --rbind /dev "$tree/dev"; mount -t proc proc "$tree/proc"; '
    f'mount --bind "$share" "$tree{_SHARE}"; exec chroot "$tree" "$@"'
)


class Unavailable(Exception):  # noqa: N818  no fault: this machine has no window, and the text says why
    """There is no Blender with a window here, and why."""


@dataclass(frozen=True)
class Place:
    """A Debian system to run Blender in: ``tree``, or this machine where that is None."""

    tree: Path | None

    def command(self, *command: str) -> list[str]:
        """What runs ``command`` there, with the folder CACHE in reach."""
        if self.tree is None:
            return list(command)
        enter = ["unshare", "--mount", "--propagation", "private", "sh", "-euc", _ENTER, "sh"]
        return [*enter, str(self.tree), str(CACHE), *command]

    def path(self, file: Path) -> str:
        """How a file in CACHE is called there."""
        return str(file) if self.tree is None else str(Path(_SHARE) / file.relative_to(CACHE))


def find_place() -> Place:
    """This machine if it has all that is needed, else the tree, which is made first. Raises Unavailable."""
    if _is_complete_here():
        return Place(None)
    if subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode != 0:
        raise Unavailable(
            f"no {_WANTED} here, and entering a Debian tree that has them needs the right to mount (root outside of a "
            "restricted container)"
        )
    if not _is_made(TREE):
        _make(TREE)
    return Place(TREE)


def _is_complete_here() -> bool:
    if not all(shutil.which(program) for program in ("blender", "Xvfb", "xdotool", "import", "convert")):
        return False
    try:
        answer = subprocess.run(["blender", "--version"], capture_output=True, text=True, timeout=60)
    except subprocess.TimeoutExpired:
        return False
    found = re.search(r"Blender (\d+)\.(\d+)", answer.stdout)
    return found is not None and tuple(map(int, found.groups())) >= OLDEST


def _is_made(tree: Path) -> bool:
    made = tree / _MADE
    return made.exists() and made.read_text().split() == [SUITE, *PACKAGES]


def _make(tree: Path) -> None:
    """Unpack Debian with Blender into ``tree``. Raises Unavailable in one line where that cannot be."""
    if os.geteuid() != 0 or not shutil.which("apt-get"):
        raise Unavailable(f"no {_WANTED} here, and only root on a Debian machine can unpack a tree with them")
    if not shutil.which("debootstrap"):
        try:
            system_libraries.require(["debootstrap"])
        except SystemExit as error:
            raise Unavailable(f"debootstrap could not be installed: {str(error.code).splitlines()[-1]}") from error
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    print(f"window: unpacking Debian {SUITE} with Blender into {tree.relative_to(ROOT)} (once)", flush=True)
    proxy = _apt_option("Acquire::http::Proxy")
    environment = os.environ | ({"http_proxy": proxy} if proxy else {}) | {"DEBIAN_FRONTEND": "noninteractive"}
    _step(environment, "debootstrap", "--variant=minbase", SUITE, str(tree), _mirror())
    _copy_configuration(tree)
    place = Place(tree)
    for command in (("update",), ("install", "--yes", "--no-install-recommends", *PACKAGES), ("clean",)):
        _step(environment, *place.command("apt-get", "--quiet", *command))
    (tree / _MADE).write_text("\n".join((SUITE, *PACKAGES)))


def _step(environment: dict[str, str], *command: str) -> None:
    answer = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, stdin=subprocess.DEVNULL
    )
    if answer.returncode != 0:
        (CACHE / "make.log").write_text(answer.stdout)
        last = (answer.stdout.strip().splitlines() or ["nothing"])[-1]
        name = "apt-get" if "apt-get" in command else command[0]
        raise Unavailable(f"{name} failed ({last}); all it said is in .cache/window/make.log")


def _mirror() -> str:
    """The Debian archive that this machine installs from."""
    places = [Path("/etc/apt/sources.list"), *sorted(Path("/etc/apt/sources.list.d").glob("*"))]
    text = "\n".join(place.read_text() for place in places if place.suffix in (".list", ".sources") and place.is_file())
    lines = [line for line in text.splitlines() if re.match(r"\s*(deb\s|URIs:)", line)]
    urls = re.findall(r"\b(?:https?|file):\S+", "\n".join(lines))
    archives = [url for url in urls if re.search(r"/debian/?$", url)]
    return archives[0] if archives else "http://deb.debian.org/debian"


def _apt_option(name: str) -> str:
    answer = subprocess.run(["apt-config", "shell", "VALUE", name], capture_output=True, text=True)
    return answer.stdout.partition("=")[2].strip().strip("'")


def _copy_configuration(tree: Path) -> None:
    """How this machine reaches the network: name servers, certificates, apt's proxies and limits."""
    for place in ("/etc/resolv.conf", "/etc/hosts", "/etc/ssl/certs/ca-certificates.crt"):
        if Path(place).exists():
            (tree / place[1:]).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(place, tree / place[1:])
    dump = subprocess.run(["apt-config", "dump", "Acquire"], capture_output=True, text=True, check=True).stdout
    (tree / "etc/apt/apt.conf.d/90machine").write_text(dump)
