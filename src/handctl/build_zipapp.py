"""`python -m handctl.build_zipapp [-o handctl.pyz]`: one file that runs with any Python 3.10+, without a network.

It contains handctl and its installed runtime dependencies; nothing is downloaded. Compiled extensions are left out (crcmod
and wrapt have equivalents in Python), so the file runs on every machine. Packages that only older Pythons need are added
if they are installed; otherwise the file requires a Python that does not need them. Byte code of the building
Python is included: another version ignores it and starts slower. The same input gives the same bytes.
"""

from __future__ import annotations

import json
import os
import posixpath
import stat
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path

USAGE = "usage: python -m handctl.build_zipapp [-o FILE]\n"
OWN = "handctl"
Version = tuple[int, int]
OLDEST: Version = (3, 10)
MAIN = """import sys

if sys.version_info < ({0}, {1}):
    sys.stderr.write("handctl: error: handctl needs Python {0}.{1} or newer, and this is Python %d.%d.\\n" % sys.version_info[:2])
    sys.stderr.write("  Next: Run this file with a newer Python, for example `python{0}.{1} handctl.pyz`.\\n")
    sys.exit(1)

from handctl.cli import main

sys.exit(main())
"""
"""Any Python can read it, also version 2: what needs a newer one is imported behind the question."""
UNUSED = ("pygments",)
"""rich needs it for listings of source code only, which handctl does not print; it would be half of the file."""
LEFT_OUT = (".so", ".pyd", ".pyc", ".pyi", ".exe")
EPOCH = (1980, 1, 1, 0, 0, 0)


COMPILE = """import json, py_compile, sys
for path, made, inside in json.load(sys.stdin):
    try:
        py_compile.compile(path, made, dfile=inside, doraise=True, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
    except py_compile.PyCompileError as exc:
        sys.exit(f"{path}: {exc.msg.strip()}")
"""


class BuildError(Exception):
    """The file cannot be built; the text says why and what to do."""


def main(argv: Sequence[str] | None = None) -> int:
    """Build the file; returns the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    if words[:1] in (["-h"], ["--help"]):
        sys.stdout.write(USAGE)
        return 0
    if words and (len(words) != 2 or words[0] not in ("-o", "--output")):
        sys.stderr.write(USAGE)
        return 2
    target = Path(words[1] if words else "handctl.pyz")
    try:
        oldest = build(target)
    except (BuildError, OSError) as exc:
        sys.stderr.write(f"build_zipapp: error: {exc}\n")
        return 1
    sys.stdout.write(f"{target}: {target.stat().st_size / 1e6:.1f} MB, for Python {_dotted(oldest)} and newer\n")
    if oldest > OLDEST:
        sys.stdout.write(f"For Python {_dotted(OLDEST)}, run `pip install tomli` and build it again.\n")
    return 0


def build(target: Path) -> Version:
    """Write the archive to `target`, whole or not at all; returns the oldest Python that runs it. Raises BuildError, OSError."""
    oldest = oldest_here()
    files = dict(sorted(_everything(oldest)))
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=".handctl-", suffix=".pyz")
    try:
        with open(handle, "wb") as file, tempfile.TemporaryDirectory() as scratch:
            file.write(b"#!/usr/bin/env python3\n")
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
                _add(archive, "__main__.py", MAIN.format(*oldest).encode())
                compiled = _byte_code({inside: path for inside, path in files.items() if path.suffix == ".py"}, scratch)
                for inside, path in files.items():
                    if inside in compiled:
                        # not compressed: to take it out of the archive would be a tenth of a start
                        _add(archive, f"{inside}c", Path(compiled[inside]).read_bytes(), zipfile.ZIP_STORED)
                    _add(archive, inside, path.read_bytes())
        os.chmod(name, stat.S_IMODE(os.stat(name).st_mode) | 0o755)  # noqa: S103 - a program for all
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return oldest


def _dotted(version: Version) -> str:
    return f"{version[0]}.{version[1]}"


def oldest_here() -> Version:
    """The oldest Python for which all that handctl needs is installed here."""
    here = sys.version_info[:2]
    for minor in range(OLDEST[1], here[1]):
        try:
            list(_needed(OWN, {OWN}, (3, minor)))
        except BuildError:
            continue
        return (3, minor)
    return here


def _add(archive: zipfile.ZipFile, inside: str, content: bytes, how: int = zipfile.ZIP_DEFLATED) -> None:
    entry = zipfile.ZipInfo(inside, EPOCH)
    entry.compress_type = how
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)


def _byte_code(modules: dict[str, Path], scratch: str) -> dict[str, str]:
    """Name in the archive -> its byte code, valid whatever the time stamp of its source.

    A process of its own makes it, always in the same state: how often a string is referred to, which depends on all that is
    loaded, and the seed of the hashes both show in what `marshal` writes.
    """
    made = {inside: str(Path(scratch, f"{number}.pyc")) for number, inside in enumerate(modules)}
    jobs = [(str(path), made[inside], inside) for inside, path in modules.items()]
    done = subprocess.run(
        [sys.executable, "-S", "-c", COMPILE],
        input=json.dumps(jobs), env={**os.environ, "PYTHONHASHSEED": "0"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode != 0:
        raise BuildError(f"A module is not valid for this Python: {done.stderr.strip()}")
    return made


def _everything(oldest: Version) -> Iterator[tuple[str, Path]]:
    """Path in the archive -> file: handctl, then every distribution that it needs with the oldest Python or this one."""
    package = Path(__file__).parent
    for path in package.rglob("*"):
        if path.is_file() and _wanted(path):
            yield f"{OWN}/{path.relative_to(package).as_posix()}", path
    for distribution in (*_needed(OWN, {OWN}, sys.version_info[:2]), *_needed(OWN, {OWN}, oldest)):
        top = Path(str(distribution.locate_file("")))
        for inside in _files_of(distribution, top):
            path, parts = top / inside, inside.split("/")
            if ".." not in parts and path.is_file() and _wanted(path) and _kept(parts):
                yield inside, path


def _files_of(distribution: metadata.Distribution, top: Path) -> Iterator[str]:
    """Paths below `top`. Without a wheel, pip of Python 3.10 installs crcmod with a list that begins in the folder of its notes."""
    listed = distribution.read_text("installed-files.txt")
    notes = next(top.glob(f"{distribution.name}-{distribution.version}*.egg-info"), None)
    if listed is not None and notes is not None:
        for line in listed.split():
            yield posixpath.normpath(f"{notes.name}/{line}")
        return
    if distribution.files is None:
        raise BuildError(f"{distribution.name}: its list of files is missing. Install it with pip")
    for file in distribution.files:
        yield file.as_posix()


def _wanted(path: Path) -> bool:
    return path.suffix not in LEFT_OUT and "__pycache__" not in path.parts


def _kept(parts: Sequence[str]) -> bool:
    """Keep only the version and the license from the installer's metadata."""
    if not parts[0].endswith((".dist-info", ".egg-info")):
        return True
    return parts[1] in ("METADATA", "PKG-INFO", "licenses") or parts[1].startswith(
        ("LICENSE", "LICENCE", "COPYING", "NOTICE")
    )


def _needed(name: str, seen: set[str], python: Version) -> Iterator[metadata.Distribution]:
    """The distributions that `name` needs with `python`, and those that they need, each once; not `name` itself."""
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    try:
        requirements = metadata.requires(name) or []
    except metadata.PackageNotFoundError as exc:
        raise BuildError(f"{name} is not installed. Run `pip install .` in the project first") from exc
    environment = {"extra": "", "python_version": _dotted(python), "python_full_version": f"{_dotted(python)}.0"}
    for requirement in map(Requirement, requirements):
        other = canonicalize_name(requirement.name)
        if (
            other in seen
            or other in UNUSED
            or not (requirement.marker is None or requirement.marker.evaluate(environment))
        ):
            continue
        seen.add(other)
        try:
            yield metadata.distribution(other)
        except metadata.PackageNotFoundError as exc:
            raise BuildError(f"{other} is not installed. Run `pip install {other}`") from exc
        yield from _needed(other, seen, python)


if __name__ == "__main__":
    sys.exit(main())
