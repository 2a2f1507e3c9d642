"""The JSON envelope of an error that arose before the settings were known: of the command line itself, or of the configuration file."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from typing import Any

from handctl.errors import HandctlError
from handctl.families import COMMANDS
from handctl.frame.envelope import make_envelope
from handctl.frame.options import config_path, read_config
from handctl.screen.filter import utf8_stdout


def in_file(key: str) -> Any:
    """What the configuration file says of an option, for errors before the settings were known; None when it cannot tell."""
    try:
        entry = read_config(config_path()).values.get(key)
    except HandctlError:
        return None
    return entry.value if entry is not None else None


def late_envelope(args: Sequence[str], error: HandctlError, streams: bool, command: str, extra: dict[str, Any]) -> None:
    """JSON on stdout also when the command line itself was wrong, if JSON was asked for."""
    words = list(args)
    wanted = os.environ.get("HANDCTL_FORMAT", "") or ("json" if os.environ.get("HANDCTL_JSON") else "")
    for position, word in enumerate(words):
        if word == "--json":
            wanted = "json"
        elif word == "--format" and position + 1 < len(words):
            wanted = words[position + 1]
        elif word.startswith("--format="):
            wanted = word.partition("=")[2]
    wanted = wanted or str(in_file("format") or ("json" if in_file("json") else ""))
    if wanted not in ("json", "ndjson"):
        return
    if not command:
        names = [word for word in words if not word.startswith("-")]
        start = next((position for position, word in enumerate(names) if word in COMMANDS), len(names))
        command = " ".join(names[start : start + 2])
    envelope = make_envelope(command, error, None, (), None, extra)
    utf8_stdout()
    try:
        sys.stdout.write(
            json.dumps({"end": envelope} if streams or wanted == "ndjson" else {**envelope, "rows": []}) + "\n"
        )
        sys.stdout.flush()
    except OSError:
        return  # the error itself is still told on stderr
