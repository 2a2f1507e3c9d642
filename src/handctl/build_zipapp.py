"""`python -m handctl.build_zipapp [-o handctl.pyz]`: one file that runs with any Python 3.11+, without a network.

It holds handctl and its runtime dependencies as they are installed beside it; nothing is downloaded. Compiled
extensions stay out (crcmod and wrapt have equivalents in Python), so the file fits every machine. Byte code of the
building Python is included: another version ignores it and starts slower. The same input gives the same bytes.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path

USAGE = "usage: python -m handctl.build_zipapp [-o FILE]\n"
OWN = "handctl"
OLDEST = (3, 11)
MAIN = f"""import sys

if sys.version_info < {OLDEST}:
    sys.stderr.write("handctl: error: handctl needs Python {OLDEST[0]}.{OLDEST[1]} or newer, and this is Python %d.%d.\\n" % sys.version_info[:2])
    sys.stderr.write("  next: Run this file with a newer Python, for example `python{OLDEST[0]}.{OLDEST[1]} handctl.pyz`.\\n")
    sys.exit(1)

from handctl.cli import main

sys.exit(main())
"""
"""Any Python can read it, also version 2: what needs a newer one is imported behind the question."""
UNUSED = ("pygments",)
"""rich needs it for listings of source code only, which handctl does not print; it would be half of the file."""
LEFT_OUT = (".so", ".pyd", ".pyc", ".pyi", ".exe")
EPOCH = (1980, 1, 1, 0, 0, 0)


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
        build(target)
    except (BuildError, OSError) as exc:
        sys.stderr.write(f"build_zipapp: error: {exc}\n")
        return 1
    sys.stdout.write(f"{target}: {target.stat().st_size / 1e6:.1f} MB\n")
    return 0


def build(target: Path) -> None:
    """Write the archive to `target`, whole or not at all. Raises BuildError, OSError."""
    files = dict(sorted(_everything()))
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=".handctl-", suffix=".pyz")
    try:
        with open(handle, "wb") as file, tempfile.TemporaryDirectory() as scratch:
            file.write(b"#!/usr/bin/env python3\n")
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
                _add(archive, "__main__.py", MAIN.encode())
                for inside, path in files.items():
                    content = path.read_bytes()
                    if path.suffix == ".py":
                        _add(archive, f"{inside}c", _byte_code(path, inside, Path(scratch)))
                    _add(archive, inside, content)
        os.chmod(name, stat.S_IMODE(os.stat(name).st_mode) | 0o755)  # noqa: S103 - a program for all
        os.replace(name, target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _add(archive: zipfile.ZipFile, inside: str, content: bytes) -> None:
    entry = zipfile.ZipInfo(inside, EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)


def _byte_code(path: Path, inside: str, scratch: Path) -> bytes:
    """The module's byte code, valid whatever the time stamp of its source."""
    import py_compile

    try:
        made = py_compile.compile(
            str(path),
            str(scratch / "module.pyc"),
            dfile=inside,
            doraise=True,
            invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH,
        )
    except py_compile.PyCompileError as exc:
        raise BuildError(f"{path} is not a valid module for this Python: {exc.msg.strip()}") from exc
    return Path(str(made)).read_bytes()


def _everything() -> Iterator[tuple[str, Path]]:
    """Path in the archive -> file: handctl, then every distribution that it needs."""
    package = Path(__file__).parent
    for path in package.rglob("*"):
        if path.is_file() and _wanted(path):
            yield f"{OWN}/{path.relative_to(package).as_posix()}", path
    for distribution in _needed(OWN, {OWN}):
        files = distribution.files
        if files is None:
            raise BuildError(f"{distribution.name}: its list of files is missing. Install it with pip")
        for file in files:
            path = Path(str(file.locate()))
            if ".." not in file.parts and path.is_file() and _wanted(path) and _kept(file.parts):
                yield file.as_posix(), path


def _wanted(path: Path) -> bool:
    return path.suffix not in LEFT_OUT and "__pycache__" not in path.parts


def _kept(parts: Sequence[str]) -> bool:
    """Of the installer's notes only what tells version and licence."""
    if not parts[0].endswith((".dist-info", ".egg-info")):
        return True
    return parts[1] in ("METADATA", "licenses") or parts[1].startswith(("LICENSE", "LICENCE", "COPYING", "NOTICE"))


def _needed(name: str, seen: set[str]) -> Iterator[metadata.Distribution]:
    """The distributions that `name` needs, and those that they need, each once; not `name` itself."""
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    try:
        requirements = metadata.requires(name) or []
    except metadata.PackageNotFoundError as exc:
        raise BuildError(f"{name} is not installed. Run `pip install .` in the project first") from exc
    for requirement in map(Requirement, requirements):
        other = canonicalize_name(requirement.name)
        if (
            other in seen
            or other in UNUSED
            or not (requirement.marker is None or requirement.marker.evaluate({"extra": ""}))
        ):
            continue
        seen.add(other)
        try:
            yield metadata.distribution(other)
        except metadata.PackageNotFoundError as exc:
            raise BuildError(f"{other} is not installed. Run `pip install {other}`") from exc
        yield from _needed(other, seen)


if __name__ == "__main__":
    sys.exit(main())
