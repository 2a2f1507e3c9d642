"""`python .packaging/windows/assemble.py FOLDER`: a Windows Python that runs under wine, put together in FOLDER.

Nothing of python.org is needed: the interpreter's library and its extension modules come from a wheel that carries them
to ship games, the standard library from the Python that runs this, the launcher is compiled here, and the packages are
those of the checkout's `.venv`, in the same versions. wine and the compiler come from Debian. What cannot be had is said in one
line, exit code 77. A second run finds everything in place.

FOLDER/py      the Windows Python
FOLDER/prefix  wine's own folder, set up
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
import zipfile
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path

SKIPPED = 77
"""Exit code: the parts cannot be had here."""
CARRIER = "panda3d==1.10.16"
"""A wheel for win_amd64 whose folder deploy_libs holds python3xx.dll and the extension modules of CPython."""
DEBIAN = {"wine64": "wine64", "wine": "wine", "x86_64-w64-mingw32-gcc": "gcc-mingw-w64-x86-64"}
"""Program -> Debian package. `wine` brings the folders that wine64 needs."""
ONLY_WINDOWS = ("colorama",)
"""What click wants there and has no use for here."""
BOOT_SECONDS = 120.0
LOOK_SECONDS = 0.2
"""Between two looks whether a process has ended."""
NO_WHEEL = ("crcmod",)
"""Packages without a wheel for Windows: what of them is Python is copied from here."""
TESTING = (
    "pytest",
    "hypothesis",
    "jsonschema==4.17.3",
    "pyrsistent",
    "attrs",
    "sortedcontainers",
    "iniconfig",
    "pluggy",
)
"""For the tests that can run there; of jsonschema the last version without compiled parts, which wine does not load."""

LAUNCHER = r"""
#include <windows.h>
typedef int (*run_python)(int, wchar_t **);
int wmain(int count, wchar_t **words)
{
    HMODULE library = LoadLibraryW(L"python%d%d.dll");
    run_python run = library ? (run_python)(void *)GetProcAddress(library, "Py_Main") : NULL;
    return run ? run(count, words) : 111;
}
"""


class Missing(Exception):
    """A part cannot be had; the text says which, in one line."""


def main(words: Sequence[str]) -> int:
    """Put it together; the exit code."""
    if len(words) != 1 or words[0].startswith("-"):
        sys.stderr.write("usage: assemble.py FOLDER\n")
        return 2
    home = Path(words[0]).resolve()
    try:
        assemble(home)
    except Missing as exc:
        sys.stderr.write(f"skipped: {exc}\n")
        return SKIPPED
    return 0


def assemble(home: Path) -> None:
    """Everything, unless the same parts are there already. Raises Missing."""
    programs()
    home.mkdir(parents=True, exist_ok=True)
    python, stamp = home / "py", home / "parts"
    made_by = [
        hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (Path(__file__), Path(__file__).with_name("wine_shims.py"))
    ]
    parts = "\n".join([sys.version, CARRIER, *packages(), *TESTING, *made_by])
    if not stamp.exists() or stamp.read_text(encoding="utf-8") != parts:
        stamp.unlink(missing_ok=True)
        shutil.rmtree(python, ignore_errors=True)
        interpreter(python, home / "cache")
        launcher(python)
        library(python)
        stamp.write_text(parts, encoding="utf-8")
    boot(home / "prefix")


# -- programs ---------------------------------------------------------------------------------------------------------


def wine() -> str:
    """The wine for 64 bit programs, "" where there is none; Debian keeps it beside the path."""
    return shutil.which("wine64") or shutil.which("wine64", path="/usr/lib/wine") or ""


def server() -> str:
    """What wine's processes share."""
    return shutil.which("wineserver") or shutil.which("wineserver", path="/usr/lib/wine") or ""


def programs() -> None:
    """Install what is missing, where this user may. Raises Missing."""

    def absent() -> list[str]:
        there = {"wine64": wine(), "wine": server()}
        return [package for name, package in DEBIAN.items() if not there.get(name, shutil.which(name))]

    if wanted := absent():
        if os.geteuid() == 0 and shutil.which("apt-get"):
            quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
            for words in (["update"], ["install", "-y", "--no-install-recommends", *wanted]):
                subprocess.run(
                    ["apt-get", "-qq", *words],
                    env=quiet,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    check=False,
                )
        if wanted := absent():
            raise Missing(f"{' and '.join(wanted)} of Debian cannot be installed here")


def environment(prefix: Path) -> dict[str, str]:
    """What wine needs to know, and keep silent about."""
    unwanted = (
        "mscoree,mshtml,winemenubuilder.exe,winedbg.exe="  # no .NET, browser or menu, and no debugger when one crashes
    )
    return {
        **os.environ,
        "WINEPREFIX": str(prefix),
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": unwanted,
        "WINEARCH": "win64",
    }


def boot(prefix: Path) -> None:
    """Wine's own folder, set up, its server and its services running until they are ended. Raises Missing.

    They are started here, with no stream of ours: else the first program starts them, and they keep its pipes open.
    """
    prefix.mkdir(parents=True, exist_ok=True)
    own, null = environment(prefix), subprocess.DEVNULL
    first = [] if (prefix / "booted").exists() else ["-i"]
    try:
        subprocess.run([server(), "-p"], env=own, stdin=null, stdout=null, stderr=null, check=False)
        subprocess.run(
            [wine(), "wineboot", *first],
            env=own,
            stdin=null,
            stdout=null,
            stderr=null,
            start_new_session=True,
            timeout=BOOT_SECONDS,
            check=True,
        )
    except (OSError, subprocess.SubprocessError) as exc:
        raise Missing(f"wine does not set itself up: {exc}") from exc
    (prefix / "booted").touch()


def said(process: subprocess.Popen[bytes], stdin: bytes, seconds: float) -> tuple[bytes, bytes]:
    """What a process writes until it ends. Raises TimeoutExpired.

    The first one that has a window starts wine's desktop, which has its pipes too, and keeps them for longer.
    """
    until, over = time.monotonic() + seconds, False
    while True:
        try:
            out, err = process.communicate(stdin, LOOK_SECONDS)
        except subprocess.TimeoutExpired as exc:
            if over:  # it had ended before: all that it wrote has been read
                return exc.output or b"", exc.stderr or b""
            over, stdin = process.poll() is not None, b""
            if not over and time.monotonic() > until:
                raise
        else:
            return out or b"", err or b""


# -- the Windows Python -----------------------------------------------------------------------------------------------


def pip(*words: str) -> bool:
    """Whether pip did it for Windows."""
    kind = f"{sys.version_info[0]}.{sys.version_info[1]}"
    told = ["--platform", "win_amd64", "--python-version", kind, "--only-binary=:all:", "--no-deps"]
    command = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check", *words, *told]
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0


def interpreter(python: Path, cache: Path) -> None:
    """The library, its extension modules and the standard library. Raises Missing."""
    tag = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    name = CARRIER.replace("==", "-")
    if not list(cache.glob(f"{name}-{tag}-*.whl")) and not pip("download", "-d", str(cache), CARRIER):
        raise Missing(
            f"{CARRIER} for Windows and Python {sys.version_info[0]}.{sys.version_info[1]} cannot be downloaded"
        )
    (wheel,) = cache.glob(f"{name}-{tag}-*.whl")
    (python / "DLLs").mkdir(parents=True)
    with zipfile.ZipFile(wheel) as archive:
        for item in archive.infolist():
            folder, _, file = item.filename.rpartition("/")
            if folder != "deploy_libs" or file.lower().startswith(("api-ms", "tcl", "tk", "_tkinter")):
                continue  # wine has the C library, and nobody needs windows
            beside = file.lower().startswith(("python3", "vcruntime"))
            (python / ("" if beside else "DLLs") / file).write_bytes(archive.read(item))
    skipped = (
        "__pycache__",
        "lib-dynload",
        "site-packages",
        "test",
        "tests",
        "idlelib",
        "tkinter",
        "turtledemo",
        "config-*",
    )
    shutil.copytree(
        sysconfig.get_path("stdlib"), python / "Lib", ignore=shutil.ignore_patterns(*skipped), dirs_exist_ok=True
    )


def launcher(python: Path) -> None:
    """python.exe, which calls the library. Raises Missing."""
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch, "launcher.c")
        source.write_text(LAUNCHER % sys.version_info[:2], encoding="utf-8")
        command = ["x86_64-w64-mingw32-gcc", "-O2", "-municode", "-o", str(python / "python.exe"), str(source)]
        if subprocess.run(command, check=False).returncode:
            raise Missing("the launcher of python.exe cannot be compiled")


# -- packages ---------------------------------------------------------------------------------------------------------


def packages() -> list[str]:
    """NAME==VERSION of everything that handctl needs, as it is installed beside it. Raises Missing."""
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    def needed(name: str) -> Iterator[str]:
        for text in metadata.requires(name) or []:
            requirement = Requirement(text)
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                yield canonicalize_name(requirement.name)

    try:
        found: dict[str, str] = {}
        waiting = list(needed("handctl"))
        while waiting:
            name = waiting.pop()
            if name not in found:
                found[name] = metadata.version(name)
                waiting += needed(name)
    except metadata.PackageNotFoundError as exc:
        raise Missing(f"{exc.name} is not installed beside {sys.executable}") from exc
    return [f"{name}=={version}" for name, version in sorted(found.items())]


def library(python: Path) -> None:
    """The packages, as wheels for Windows. Raises Missing."""
    target = python / "Lib" / "site-packages"
    target.mkdir()
    wanted = [*packages(), *ONLY_WINDOWS, *TESTING]
    pure = [name for name in wanted if name.partition("==")[0] in NO_WHEEL]
    if not pip("install", "--target", str(target), *(name for name in wanted if name not in pure)):
        raise Missing("the packages that handctl needs cannot be downloaded for Windows")
    for name in pure:
        copied(name.partition("==")[0], target)
    shutil.copy(Path(__file__).with_name("wine_shims.py"), target / "sitecustomize.py")


def copied(name: str, target: Path) -> None:
    """An installed package, of which only what is Python is taken. Raises Missing."""
    try:
        files = metadata.distribution(name).files or []
    except metadata.PackageNotFoundError as exc:
        raise Missing(f"{name} for Windows cannot be downloaded") from exc
    for file in files:
        if file.suffix not in (".so", ".pyc") and ".." not in file.parts:
            place = target / file
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(Path(str(file.locate())), place)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
