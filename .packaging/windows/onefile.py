"""`python .packaging/windows/onefile.py PARTS DIST`: DIST/handctl.exe, built by PyInstaller in the Python of `assemble.py`, and tried.

PARTS is what assemble.py has put together. The parts of handctl are imported by name, so all of them are named to PyInstaller.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import assemble

CHECKOUT = Path(__file__).resolve().parents[2]
BUILDERS = (
    *("pyinstaller", "pyinstaller-hooks-contrib", "altgraph", "packaging"),
    *("setuptools", "pefile", "pywin32-ctypes"),
)
MAIN = """
import sys

if sys.argv[1:] == ["deadman", "inherited"]:  # as handctl.system.watchdog_process starts it
    from handctl.system.watchdog_process import live

    live()
from handctl.cli import main

sys.exit(main())
"""
DESCRIPTION = """
VSVersionInfo(
    ffi=FixedFileInfo(filevers={numbers}, prodvers={numbers}),
    kids=[
        StringFileInfo([StringTable("040904B0", [
            StringStruct("FileDescription", "handctl"), StringStruct("ProductName", "handctl"),
            StringStruct("ProductVersion", "{version}"), StringStruct("FileVersion", "{version}"),
            StringStruct("OriginalFilename", "handctl.exe"), StringStruct("Comments", "{comments}"),
        ])]),
        VarFileInfo([VarStruct("Translation", [0x409, 1200])]),
    ],
)
"""
"""What Windows shows of the file; the comments name every family."""
BUILD_SECONDS, TRY_SECONDS = 900, 120
PORT = 9
"""Of the COM port that the test takes."""


def main(words: Sequence[str]) -> int:
    """Build it and try it; the exit code."""
    if len(words) != 2:
        sys.stderr.write("usage: onefile.py PARTS DIST\n")
        return 2
    parts, dist = (Path(word).resolve() for word in words)
    try:
        assemble.boot(parts / "prefix")
        made = build(parts, dist)
        for said in tried(parts, made):
            sys.stdout.write(f"{said}\n")
    except (assemble.Missing, AssertionError, OSError, subprocess.SubprocessError) as exc:
        sys.stderr.write(f"onefile: error: {exc}\n")
        return 1
    finally:
        subprocess.run([assemble.server(), "-k"], env=assemble.environment(parts / "prefix"), check=False)
    sys.stdout.write(f"{made}: {made.stat().st_size / 1e6:.1f} MB\n")
    return 0


def there(path: Path) -> str:
    """A path as Windows programs see it."""
    return "Z:" + str(path).replace("/", "\\")


def run(parts: Path, words: Sequence[str], seconds: float, **more: str) -> tuple[int, str]:
    """A program under wine, its streams on pipes; exit code, and all that it wrote."""
    process = subprocess.Popen(
        [assemble.wine(), *words],
        env={**assemble.environment(parts / "prefix"), **more},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    try:
        out, _ = assemble.said(process, b"", seconds)
    finally:
        process.kill()
    return process.returncode, out.decode("utf-8", "replace")


def build(parts: Path, dist: Path) -> Path:
    """dist/handctl.exe. Raises Missing where PyInstaller cannot be had."""
    tools, work = parts / "builders", parts / "onefile"
    wanted = "\n".join(BUILDERS)
    if not (tools / "wanted").exists() or (tools / "wanted").read_text(encoding="utf-8") != wanted:
        shutil.rmtree(tools, ignore_errors=True)
        if not assemble.pip("install", "--target", str(tools), *BUILDERS):
            raise assemble.Missing("PyInstaller for Windows cannot be downloaded")
        (tools / "wanted").write_text(wanted, encoding="utf-8")
    work.mkdir(exist_ok=True)
    (work / "handctl_main.py").write_text(MAIN, encoding="utf-8")
    (work / "description.txt").write_text(description(), encoding="utf-8")
    words = ["--noconfirm", "--onefile", "--console", "--name", "handctl", "--log-level", "WARN"]
    words += ["--version-file", there(work / "description.txt")]
    words += ["--distpath", there(work / "dist"), "--workpath", there(work), "--specpath", there(work)]
    for package in ("handctl", "serial", "rich"):
        words += ["--collect-submodules", package]
    words += ["--collect-data", "handctl", "--exclude-module", "tkinter", "--exclude-module", "pytest"]
    for package in assemble.packages():
        words += ["--copy-metadata", package.partition("==")[0]]
    words += ["--runtime-hook", there(Path(__file__).with_name("wine_shims.py")), there(work / "handctl_main.py")]
    code, said = run(
        parts,
        [str(parts / "py" / "python.exe"), "-m", "PyInstaller", *words],
        BUILD_SECONDS,
        PYTHONPATH=f"{there(tools)};{there(CHECKOUT / 'src')}",
        PYTHONPYCACHEPREFIX=there(parts / "compiled"),
        WINE_AS_PYINSTALLER_CONFIG_DIR=there(work),
    )
    made = work / "dist" / "handctl.exe"
    if code or not made.exists():
        raise AssertionError(f"PyInstaller ended with {code}:\n{said[-3000:]}")
    dist.mkdir(exist_ok=True)
    return Path(shutil.copy(made, dist / "handctl.exe"))


def description() -> str:
    """The file for --version-file of PyInstaller."""
    from handctl import __version__
    from handctl.families import FAMILIES

    numbers = (*(int(part) for part in __version__.split(".")[:3]), 0)
    names = "; ".join(family.help for family in FAMILIES.values())
    comments = f"Diagnostics and configuration of: {names}. It is not a medical device."
    return DESCRIPTION.format(numbers=numbers, version=__version__, comments=comments)


def tried(parts: Path, made: Path) -> list[str]:
    """What was seen of it under wine. Raises AssertionError."""
    from handctl import __version__

    found = []

    def says(wanted: str, *words: str) -> None:
        code, out = run(parts, [str(made), *words], TRY_SECONDS)
        assert code == 0 and wanted in out, f"handctl.exe {' '.join(words)}: exit code {code}:\n{out[-2000:]}"
        found.append(
            f"handctl.exe {' '.join(words)}: {next(line for line in out.splitlines() if wanted in line).strip()}"
        )

    says(f"handctl {__version__}", "--version")
    says("558", "exo", "dump", "--fake")
    with tempfile.TemporaryDirectory() as scratch:
        port, panel = Path(scratch, "hand"), Path(scratch, "panel")
        simulator = subprocess.Popen(
            [sys.executable, "-m", "handctl", "sim", "exo", "--pty", "--by-id", str(port), "--control", str(panel)],
            stdout=subprocess.PIPE,
        )
        link = parts / "prefix" / "dosdevices" / f"com{PORT}"
        try:
            assert simulator.stdout is not None
            json.loads(simulator.stdout.readline())
            link.unlink(missing_ok=True)
            link.symlink_to(os.readlink(port))
            says("558", "exo", "dump", "-p", f"COM{PORT}")
            says("500", "exo", "position", *("500",) * 5, "--wait", "5", "--yes", "-p", f"COM{PORT}")
            found.append(killed(parts, made, panel))
        finally:
            simulator.terminate()
            simulator.wait(10)
            link.unlink(missing_ok=True)
    return found


def killed(parts: Path, made: Path, panel: Path) -> str:
    """It and its unpacked self are killed while the hand moves: the second process must stop the hand. Raises AssertionError."""
    from handctl.sim.engine.serve import send_control

    def place() -> bytes:
        return bytes.fromhex(send_control(str(panel), "get 1546 10").removeprefix("ok "))

    until, before, target = time.monotonic() + TRY_SECONDS, place(), bytes(10)
    words = ["exo", "position", *("0",) * 5, "--wait", "30", "--yes", "-p", f"COM{PORT}"]
    process = subprocess.Popen(
        [assemble.wine(), str(made), *words], env=assemble.environment(parts / "prefix"), start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        while place() == before:
            assert time.monotonic() < until and process.poll() is None, "handctl.exe does not move the hand"
            time.sleep(0.01)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
    time.sleep(1.5)  # the whole way takes less
    assert place() not in (before, target), "handctl.exe was killed, and nothing stopped the hand"
    return f"handctl.exe {' '.join(words)}: killed in the movement, and the hand was stopped"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
