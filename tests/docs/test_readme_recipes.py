"""The recipes of the guides for other programs and for scripts do what they say: each block is run as it stands."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import GUIDES

TEXT = "\n".join((GUIDES / f"{name}.md").read_text(encoding="utf-8") for name in ("simulators", "scripts"))
BLOCK = re.compile(r"^```(python|c|sh)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCKS = BLOCK.findall(TEXT)
ANSWER = "90 eb 01 05 11 c0 05 2e 02 0c"
SECONDS = 60


def blocks(language: str) -> list[str]:
    return [text for kind, text in BLOCKS if kind == language]


def environment(folder: Path, **more: str) -> dict[str, str]:
    """The `handctl` of this Python, in an empty home."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder), **more}


def test_there_are_such_blocks() -> None:
    assert [len(blocks(language)) for language in ("python", "c", "sh")] == [2, 1, 1]


@pytest.mark.real
@pytest.mark.parametrize("text", blocks("python"))
def test_python_prints_what_its_comment_says(text: str, tmp_path: Path) -> None:
    wanted = re.findall(r"print\(.*\)  # (.*)", text)
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, timeout=SECONDS, check=False,
        env=environment(tmp_path),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == wanted != []


@pytest.mark.real
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_c_gets_the_same_answer(tmp_path: Path) -> None:
    (tmp_path / "ask.c").write_text(blocks("c")[0], encoding="ascii")
    subprocess.run(
        ["cc", "-Wall", "-Wextra", "-Werror", "-o", "ask", "ask.c"], cwd=tmp_path, check=True, timeout=SECONDS
    )
    with subprocess.Popen(
        [sys.executable, "-m", "handctl", "sim", "exo", "--pty", "--duration", str(SECONDS)], stdout=subprocess.PIPE
    ) as server:
        try:
            assert server.stdout is not None
            link = json.loads(server.stdout.readline())["link"]
            done = subprocess.run(
                ["./ask", link], cwd=tmp_path, capture_output=True, text=True, timeout=SECONDS, check=False
            )
        finally:
            server.terminate()
    assert (done.returncode, done.stdout.strip()) == (0, ANSWER)


@pytest.mark.real
@pytest.mark.skipif(shutil.which("jq") is None, reason="no jq")
@pytest.mark.parametrize(("fault", "said"), [("", "healthy"), ("&fault=over-temperature", "ring: over_temperature")])
def test_the_script_tells_a_healthy_hand_from_another(fault: str, said: str, tmp_path: Path) -> None:
    env = environment(tmp_path, HANDCTL_PORT=f"fake://exo?state={tmp_path}/state{fault}")
    subprocess.run(
        ["handctl", "exo", "snapshot", "before.json", "-q"],
        cwd=tmp_path,
        env=env,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    done = subprocess.run(
        ["sh", "-u"], input=blocks("sh")[0], capture_output=True, text=True, timeout=SECONDS, check=False, env=env,
        cwd=tmp_path,
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done
    assert lines[0].startswith("little ")
    assert len([line for line in lines if "\t" in line]) == 25
    assert said in lines[-1]
