"""One cell of the hostile suite: a command line in a place that means no good, and what must hold whatever happened there.

A documented exit code, JSON that is JSON, no character that acts on a terminal, an end in time, bounded memory, inputs as they
were, nothing left lying about. Whether an answer is right is for other tests.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import resource
import shutil
import signal
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from tests.search.suite import Hang, bounded
from tests.support.cli import Result, check_schema, run

SECONDS = 20.0
"""Of real time: a command that takes longer hangs."""
MEMORY = 64 << 20
"""Bytes that a command may take at the most, over what the process has."""
CEILING = 1 << 30
"""Bytes beyond which the system gives it none: a leak fails, and does not take the machine with it."""
OUTPUT = 16 << 20
"""Bytes of stdout and stderr that one command may write."""
MESSAGE = 4000
"""Characters of one line for people on stderr."""
DOCUMENTED = (0, 2, 3, 4, 5, 6, 7, 8)
"""Exit codes of the contract but 1, our own bug, and 130, which nobody asked for."""
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
"""What rich may write: a style."""
KEEP = {"csv": "\r\n", "plain": "\n\t", "any": "\r\n\t"}
"""Control characters that are part of a format; of the others a new line."""


class Tried(NamedTuple):
    """What one command line did in one place. `failure` is empty when all is well."""

    code: int | None
    failure: str
    told: str = ""
    """The codes of its messages, where it was asked for JSON."""


# -- the place ----------------------------------------------------------------------------------------------------


class Folder:
    """A folder with inputs that no command may change, and where nothing half written may stay."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._kept = self._contents()

    def _contents(self) -> dict[str, str]:
        found: dict[str, str] = {}
        folders = [str(self.path)]
        for folder in folders:  # it grows meanwhile
            with suppress(PermissionError), os.scandir(folder) as entries:
                for one in entries:
                    if one.is_dir(follow_symlinks=False):
                        folders.append(one.path)
                    else:
                        found[one.path] = _digest(one)
        return dict(sorted(found.items()))

    def keep(self) -> None:
        """What is there now is an input, too."""
        self._kept = self._contents()

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """A folder in it for the inputs of one command."""
        kept, path = self._kept, self.path / "scratch"
        path.mkdir()
        try:
            yield path
        finally:
            shutil.rmtree(path)
            self._kept = kept

    def tidy(self) -> tuple[str, list[Path]]:
        """What is wrong with it, and the files that are new; both are put right for the next command."""
        wrong, now = "", self._contents()
        for one, digest in self._kept.items():
            if now.get(one) != digest:
                wrong = wrong or f"{os.path.basename(one)}: an input was {'changed' if one in now else 'removed'}"
        new = [Path(one) for one in now if one not in self._kept]
        self._kept = {one: digest for one, digest in now.items() if one in self._kept}
        left = [one.name for one in new if one.suffix in (".part", ".tmp")]
        return wrong or (f"left behind: {', '.join(left)}" if left else ""), new


def _digest(one: os.DirEntry[str]) -> str:
    info = one.stat(follow_symlinks=False)
    if stat.S_ISLNK(info.st_mode):
        return os.readlink(one)
    if not stat.S_ISREG(info.st_mode):
        return str(stat.S_IFMT(info.st_mode))
    if info.st_size >= MEMORY:
        return str(info.st_size)
    with open(one, "rb", buffering=0) as file:
        return hashlib.sha256(file.readall()).hexdigest()


@contextmanager
def memory() -> Iterator[list[int]]:
    """The list gets the bytes by which this process grew meanwhile, at its peak; past CEILING it gets none any more."""
    grown: list[int] = []
    limits = resource.getrlimit(resource.RLIMIT_DATA)
    begin = _status("VmRSS")
    resource.setrlimit(resource.RLIMIT_DATA, (_status("VmData") + CEILING, limits[1]))
    try:
        with open("/proc/self/clear_refs", "w", encoding="ascii") as refs:
            refs.write("5")  # the peak begins anew
        yield grown
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, limits)
    grown.append(_status("VmHWM") - begin)


def _status(name: str) -> int:
    with open("/proc/self/status", encoding="ascii") as status:
        line = next(line for line in status if line.startswith(name))
    return int(line.split()[1]) * 1024


# -- what must hold -----------------------------------------------------------------------------------------------


def harmless(text: str, keep: str = "\n") -> bool:
    """Whether no character of it acts on a terminal."""
    return text.isprintable() or all(one.isprintable() or one in keep for one in set(COLOUR.sub("", text)))


def _acting(text: str, keep: str) -> str:
    at = next(n for n, letter in enumerate(text) if not letter.isprintable() and letter not in keep)
    return repr(text[max(0, at - 30) : at + 30])


def strict(text: str) -> Any:
    """JSON as it is defined: no NaN, no Infinity."""

    def refuse(word: str) -> Any:
        raise ValueError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refuse)


def judge_json(done: Result) -> str:
    """What is wrong with the output of a command that was asked for JSON; "" when nothing is."""
    try:
        text = done.raw.decode("utf-8")
        last = strict(text) if text.startswith("{\n") else [strict(line) for line in text.split("\n")[:-1]][-1]
        last = last.get("end", last)
        json.dumps(last, ensure_ascii=False).encode()  # half a character is no text
    except (ValueError, IndexError) as exc:
        return f"no JSON in UTF-8: {exc}: {done.raw[:80]!r}"
    try:
        check_schema(last)
    except AssertionError as exc:
        return f"against the schema: {exc}"
    if last["exit_code"] != done.code:
        return f"exit code {done.code}, and {last['exit_code']} in JSON"
    return ""


def judge_text(text: str, how: str) -> str:
    """What is wrong with a text for people, or for a spreadsheet."""
    shown = COLOUR.sub("", text) if how == "always" else text
    keep = KEEP.get(how, "\n")
    return "" if harmless(shown, keep) else f"acts on a terminal: {_acting(shown, keep)}"


def judge(
    done: Result, how: str, codes: Sequence[int] = DOCUMENTED, *, debug: bool = False, elsewhere: bool = False, verbose: bool = False
) -> str:  # fmt: skip
    """What is wrong with what one command left on stdout and stderr.

    `debug`: it was told to show where a mistake is; `elsewhere`: to write its data to a file; `verbose`: to
    show every byte.
    """
    if ("Traceback" in done.err and not debug) or "internal error" in done.err:
        return f"our own bug: {done.err.strip()[-300:]}"
    unwritten = done.code == 1 and re.search("cannot be (written|removed)", done.err) is not None  # so the contract
    if done.code not in codes and not unwritten:
        return f"exit code {done.code}: {done.err.strip()[-200:]}"
    if not harmless(done.err):
        return f"stderr {judge_text(done.err, '')}"
    if not verbose and any(len(line) > MESSAGE for line in done.err.splitlines()):
        return f"a message of {max(map(len, done.err.splitlines()))} characters"
    if len(done.raw) + len(done.err) > OUTPUT:
        return f"{len(done.raw) + len(done.err)} bytes of output"
    if how == "json":
        return judge_json(done) if done.raw or not elsewhere else ""
    return judge_text(done.out, how)


def new_file(path: Path) -> str:
    """What is wrong with a file that a command wrote."""
    if not path.is_file() or path.is_symlink():
        return ""
    content = path.read_bytes()
    if path.suffix in (".json", ".jsonl"):
        try:
            for text in content.decode("utf-8").splitlines() if path.suffix == ".jsonl" else [content.decode("utf-8")]:
                json.dumps(strict(text), ensure_ascii=False).encode()
        except ValueError as exc:
            return f"{path.name}: no JSON: {exc}"
        return ""
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as exc:
        return f"{path.name}: no UTF-8: {exc}"
    return "" if harmless(text, "\r\n\t") else f"{path.name} {judge_text(text, 'csv')}"


# -- a cell -------------------------------------------------------------------------------------------------------

FORMATS = {
    "table": (),
    "always": ("--color", "always"),
    "csv": ("--csv",),
    "plain": ("--format", "plain"),
    "json": ("--json",),
}


def _elsewhere(words: Sequence[str], env: Mapping[str, str]) -> bool:
    return "HANDCTL_OUTPUT" in env or any(word.startswith(("-o", "--output")) for word in words)


def attempt(
    words: Sequence[str], how: str, folder: Folder, env: Mapping[str, str] | None = None, *, stdin: str = "",
    codes: Sequence[int] = DOCUMENTED,
) -> Tried:  # fmt: skip
    """Run one command line; its exit code and what is wrong."""
    place = {
        "XDG_STATE_HOME": str(folder.path / "state"),
        "XDG_RUNTIME_DIR": str(folder.path),
        "HOME": str(folder.path),
    }
    try:
        with memory() as grown, bounded(SECONDS, f"handctl {' '.join(words)[:200]}"):
            done = run(*words, env={**place, **(env or {})}, stdin=stdin)
    except Hang as exc:
        signal.setitimer(signal.ITIMER_REAL, 0.0)  # an alarm of the command must not ring in the next one
        folder.tidy()
        return Tried(None, str(exc))
    except Exception as exc:  # noqa: BLE001 - that it got out of handctl is what is told
        folder.tidy()
        return Tried(None, f"our own bug: {type(exc).__name__}: {exc}")
    wrong, new = folder.tidy()
    failure = (
        judge(
            done,
            how,
            codes,
            debug="--debug" in words or "HANDCTL_DEBUG" in (env or {}),
            elsewhere=_elsewhere(words, env or {}),
            verbose="HANDCTL_VERBOSE" in (env or {}) or any(one.startswith(("-v", "--verb")) for one in words),
        )
        or wrong
        or next(filter(None, map(new_file, new)), "")
    )
    for one in new:
        one.unlink(missing_ok=True)
    shutil.rmtree(folder.path / "state", ignore_errors=True)
    if not failure and grown[0] > MEMORY:
        failure = f"{grown[0] >> 20} MiB of memory"
    return Tried(done.code, failure, _codes(done) if how == "json" and not failure else "")


def _codes(done: Result) -> str:
    """The codes of the messages of a command that gave JSON, each once."""
    text = done.raw.decode("utf-8")
    last = strict(text) if text.startswith("{\n") else strict(text.split("\n")[-2]) if text else {}
    messages = last.get("end", last).get("messages", ())
    return " ".join(sorted({message["code"] for message in messages if message["level"] != "info"}))
