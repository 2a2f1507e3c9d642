"""Who holds a lock: its file is believed only as far as the process of that number is the one that wrote it."""

from __future__ import annotations

import os
from pathlib import Path

from handctl.link import device_lock
from handctl.system import processes


def test_another_program_with_the_number_of_the_holder_is_not_named(tmp_path: Path) -> None:
    pid, file = os.getpid(), tmp_path / "lock"
    for start, known in ((processes.began(pid), True), ("", True), ("1", False)):
        file.write_text(f"{pid}\t{start}\texo\twrites\tx\thandctl exo set\n")
        descriptor = os.open(file, os.O_RDONLY)
        try:
            holder = device_lock._holder(descriptor)
        finally:
            os.close(descriptor)
        assert (holder is not None and holder.pid == pid and holder.use == "writes") == known, start
