"""Many command lines in one process: an interpreter under wine takes a second to start, a command some milliseconds.

Started on both systems. Each line of stdin is a JSON object: words, folder, environment; the answer is one JSON object: exit code,
stdout and stderr in hex. The streams begin as this system would make them, code page and line ends included. Knows handctl.
"""

from __future__ import annotations

import io
import json
import locale
import os
import signal
import sys
from typing import Any


def run(words: list[str], folder: str, environment: dict[str, str]) -> dict[str, Any]:
    """One command line, as a program of its own would find its streams, folder and variables."""
    from handctl import cli

    kept = dict(os.environ), os.getcwd(), sys.stdin, sys.stdout, sys.stderr
    handlers = {number: signal.getsignal(number) for number in signal.valid_signals() if number not in (9, 19, 32, 33)}
    page = locale.getpreferredencoding(False)
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=page, errors=how) for how in ("strict", "backslashreplace"))
    os.environ.update(environment)
    os.chdir(folder)
    sys.stdin, sys.stdout, sys.stderr = io.StringIO(""), out, err
    try:
        try:
            code = cli.main(words)
        except SystemExit as exc:
            code = exc.code if isinstance(exc.code, int) else 1
        out.flush()
        err.flush()
    finally:
        sys.stdin, sys.stdout, sys.stderr = kept[2:]
        os.chdir(kept[1])
        os.environ.clear()
        os.environ.update(kept[0])
        for number, handler in handlers.items():
            if handler is not None and signal.getsignal(number) != handler:
                signal.signal(number, handler)
    return {"code": code, "out": out.buffer.getvalue().hex(), "err": err.buffer.getvalue().hex()}  # type: ignore[attr-defined]


def main() -> None:
    """Answer each line of stdin."""
    for text in sys.stdin:
        asked = json.loads(text)
        answer = run(asked["words"], asked["folder"], asked["environment"])
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
