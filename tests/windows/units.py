"""Tests of the suite that can run under the Windows Python: codecs, maps, the model, configuration. They need no process, no
pseudo-terminal and none of the fixtures that are written for Linux."""

from __future__ import annotations

import subprocess
from pathlib import Path

from tests.windows.systems import CHECKOUT, System, assemble, end, on_windows

FILES = (
    "tests/inspire/test_eb90.py",
    "tests/inspire/test_can_frames.py",
    "tests/inspire/test_registers.py",
    "tests/ekso/test_frames.py",
    "tests/ekso/test_fields.py",
    "tests/aidin/test_messages.py",
    "tests/aidin/test_fields.py",
    "tests/barrett/test_kinematics.py",
    "tests/barrett/test_parameters.py",
    "tests/kernel/test_param.py",
    "tests/kernel/test_config.py",
    "tests/kernel/test_sampling.py",
    "tests/kernel/test_write_ledger.py",
)
LEFT_OUT = {
    "test_the_xdg_place": "folders of Linux",
    "test_what_does_not_read_back_is_not_written": "a folder cannot be locked there: a file in it is, and stays",
    "test_written_in_place_through_a_link_with_the_same_permissions": "links and permissions of Linux",
}
"""Tests of these files that Windows cannot pass, and why."""
SECONDS = 240.0


def passed(windows: System, folder: Path, files: tuple[str, ...] = FILES) -> tuple[str, str]:
    """What pytest says at the end, and what is wrong, "" for nothing."""
    folder.mkdir(exist_ok=True)
    options = ["-q", "--noconftest", "-p", "no:cacheprovider", "-o", "addopts=", "--rootdir", on_windows(CHECKOUT)]
    left_out = ["-k", " and ".join(f"not {name}" for name in LEFT_OUT)]
    process = windows.start(
        ["-X", "utf8", "-m", "pytest", *options, *left_out, *(on_windows(CHECKOUT / file) for file in files)], folder
    )
    try:
        out = assemble.said(process, b"", SECONDS)[0].decode("utf-8", "replace")
    except subprocess.TimeoutExpired:
        end(process)
        return "", f"no end within {SECONDS:.0f} s: {assemble.said(process, b'', SECONDS)[0][-300:]!r}"
    last = out.strip().rpartition("\n")[2].strip("= \r")
    return last, "" if process.returncode == 0 else out[-3000:]
