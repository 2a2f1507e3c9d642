"""A firmware download killed in the middle, over a pseudo-terminal with a power switch; then a good one (barrett §3.7)."""

from __future__ import annotations

import hashlib
import json
import signal
from pathlib import Path

import pytest

from tests.barrett.panel import download, panel
from tests.barrett.srecords import END, HEADER, record
from tests.support.cli import Simulator, wait_until

pytestmark = pytest.mark.real

DATA = bytes((number * 11 + 5) & 255 for number in range(1024))


def test_killed_in_the_middle_then_a_good_one(tmp_path: Path) -> None:
    """kill -9 leaves a hand without whole firmware, the next download heals it; the image is that of the file."""
    file, control = tmp_path / "fw.s19", tmp_path / "panel"
    lines = [HEADER, *(record(0x2000 + place, DATA[place : place + 32]) for place in range(0, 1024, 32)), END]
    file.write_text("\n".join(lines))
    simulator = Simulator(
        "--pty", "--wire", "38400", "--control", control, "--set", "image-records=32", "--set", "boot=0.2",
        "--set", "window=20", "--set", "download-version=4.34", "--set", "download-end=quiet", "--set", "download-quiet=0.3",
        kind="barrett",
    )  # fmt: skip
    try:
        first = download(simulator.link, file, control, tmp_path / "first.txt")
        wait_until(lambda: (tmp_path / "first.txt").read_text().count("bytes/s") >= 2)
        first.send_signal(signal.SIGKILL)
        first.communicate(timeout=30)
        half = panel(control, "image")
        assert hashlib.sha256(DATA).hexdigest() not in half and "image valid" not in half
        second = download(simulator.link, file, control, tmp_path / "second.txt")
        out, _ = second.communicate(timeout=30)
        content = json.loads(out)
        assert second.returncode == 0, content
        values = {row["name"]: row["value"] for row in content["rows"]}
        assert values["image_sha256"] == hashlib.sha256(DATA).hexdigest()
        assert values["version_before"] is None and "4.34" in values["firmware"]
        whole = panel(control, "image")
        assert "image valid" in whole and hashlib.sha256(DATA).hexdigest() in whole
    finally:
        simulator.stop()
