"""Edit the configuration file: add, replace or remove one `[devices.NAME]` and keep everything else byte for byte.

The standard library reads TOML but does not write it: so the text is edited by lines, read back, and refused when it
does not say exactly what was meant. Written whole or not at all.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping

from handctl.command.config_file import Config, Statement, parse, read_config, statements
from handctl.errors import OutputError, UsageError
from handctl.files import as_text, atomic_write, writing
from handctl.system import clock, file_locks

WAIT_SECONDS = 5.0
"""For another handctl that is editing the same file."""

Values = Mapping[str, str | int | float]


def put(config: Config, name: str, values: Values) -> str:
    """The file's text with the table `[devices.NAME]` holding exactly `values`; comments in a present one stay."""
    found, text = _table(config, name), config.text
    feed = "\r\n" if "\r\n" in text else "\n"
    lines = {key: f"{key} = {_toml(value)}" for key, value in values.items()}
    if not found:
        gap = "" if not text else feed if text.endswith("\n") else feed * 2
        return text + gap + feed.join([f"[devices.{name}]", *lines.values()]) + feed
    pieces, place = [text[: found[0].end]], found[0].end
    if not pieces[0].endswith("\n"):
        pieces.append(feed)
    for statement in found[1:]:
        pieces.append(text[place : statement.start])
        line = lines.pop(statement.path[-1], None)
        if line is not None:
            pieces.append(line + text[statement.code_end : statement.end])
            if not pieces[-1].endswith("\n"):
                pieces.append(feed)
        place = statement.end
    return "".join([*pieces, *(line + feed for line in lines.values()), text[place:]])


def drop(config: Config, name: str) -> str:
    """The file's text without the table `[devices.NAME]`; comments above and below it stay, one empty line goes with it."""
    found, text = _table(config, name), config.text
    if not found:
        return text
    before, after = text[: found[0].start], text[found[-1].end :]
    for empty in ("\r\n", "\n"):
        if before.endswith(f"\n{empty}") and (not after or after.startswith(empty)):
            before = before.removesuffix(empty)
            break
    return before + after


def _table(config: Config, name: str) -> list[Statement]:
    """The header and the entries of a table, [] when there is none. Raises UsageError when it is written otherwise."""
    place = ("devices", name)
    found = [statement for statement in statements(config.text) if statement.path[:2] == place]
    if found and (not found[0].header or any(one.header or len(one.path) != 3 for one in found[1:])):
        line = config.text.count("\n", 0, found[0].start) + 1
        raise UsageError(
            f"{config.path}, line {line}: {name} is not written as one table [devices.{name}]",
            hint="edit the file by hand. Nothing was changed.",
            code="config",
        )
    return found


def _toml(value: str | int | float) -> str:
    if not isinstance(value, str):
        return repr(value)
    if as_text(value) != value:
        raise UsageError(
            f"{value} has a byte that is not UTF-8, which a configuration file cannot hold",
            hint="give it another name, such as a symbolic link. Nothing was changed.",
            code="config",
        )
    import json

    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # TOML's escapes are JSON's


def change(path: str, edit: Callable[[Config], str], wanted: Values, name: str) -> None:
    """Read the file, `edit` its text, and write it; afterwards device `name` holds `wanted`, {} = there is none.

    Two handctl at once wait for each other. Raises UsageError for what is no file, is damaged, or whose edit went wrong,
    OutputError when it cannot be written.
    """
    _rewrite(path, lambda before: verified(before, edit(before), wanted, name))


def put_all(path: str, wanted: Mapping[str, Values], allow: Callable[[Config], None]) -> None:
    """Name several devices at once, all or none; `allow` raises UsageError where the present file forbids it. Raises as `change`."""

    def edit(before: Config) -> str:
        allow(before)
        for name, values in wanted.items():
            before = parse(path, verified(before, put(before, name, values), values, name))
        return before.text

    _rewrite(path, edit)


def _rewrite(path: str, edit: Callable[[Config], str]) -> None:
    target = os.path.realpath(path)
    if os.path.exists(path) and not os.path.isfile(path):  # a device, such as /dev/null, would be replaced
        raise UsageError(
            f"{path} is not a file", hint="set HANDCTL_CONFIG to another file. Nothing was changed.", code="config"
        )
    with writing(path, hint="check the folder and its permissions. Nothing was changed.", code="config"):
        os.makedirs(os.path.dirname(target), exist_ok=True)
        with _alone(os.path.dirname(target)):
            text = edit(read_config(path))
            with atomic_write(target) as file:
                file.write(text)


def verified(before: Config, text: str, wanted: Values, name: str) -> str:
    """The new text, read back: it says what was meant and all else is as before. Raises UsageError."""

    def command_line(config: Config) -> object:
        devices = {
            device.name: (device.kind, {key: entry.value for key, entry in device.entries.items()})
            for device in config.devices.values()
            if device.name != name
        }
        return {key: entry.value for key, entry in config.values.items()}, devices

    refusal = UsageError(
        f"{before.path}: handctl cannot make this change without changing other entries",
        hint="edit the file by hand. Nothing was changed.",
        code="config",
    )
    try:
        after = parse(before.path, text)
    except UsageError as exc:
        raise refusal from exc
    device = after.devices.get(name)
    got = {} if device is None else {"kind": device.kind, **{key: entry.value for key, entry in device.entries.items()}}
    if got != dict(wanted) or command_line(before) != command_line(after):
        raise refusal
    return text


@contextlib.contextmanager
def _alone(folder: str) -> Iterator[None]:
    """Hold the folder of the file, so that of two edits at once none is lost."""
    descriptor = file_locks.folder(folder)
    try:
        end = clock.now() + WAIT_SECONDS
        while True:
            try:
                file_locks.whole(descriptor)
                break
            except BlockingIOError as exc:
                if clock.now() > end:
                    raise OutputError(
                        f"{folder}: another program holds the folder", hint="try again. Nothing was changed."
                    ) from exc
                clock.sleep(0.05)
        yield
    finally:
        os.close(descriptor)


# -- a name of a port that outlives the next plugging ---------------------------------------------------------------


BY_ID = "/dev/serial/by-id"
TTY = "/sys/class/tty"


def stable_name(port: str) -> str:
    """A name of this adapter itself for a path like /dev/ttyUSB0: its by-id link, or usb:VID:PID:SERIAL; "" = none."""
    name = os.path.basename(port)
    if not name.startswith(("ttyUSB", "ttyACM")) or os.path.dirname(port) != "/dev":
        return ""
    real = os.path.realpath(port)
    try:
        links = sorted(os.path.join(BY_ID, entry) for entry in os.listdir(BY_ID))
    except OSError:
        links = []
    for link in links:
        if os.path.realpath(link) == real:
            return link
    from handctl.system import serial_ports

    usb = serial_ports.usb_name(serial_ports.usb_folder(os.path.join(TTY, name, "device")))
    return f"usb:{usb}" if usb else ""
