"""The lock of a device: one process at a time, held while a link is open. Its file names the holder.

The lock is an flock on a file of this user, so the system releases it when the process ends. Its first line names the
holder and its command, and is empty if there is none. The second is the device that a command met last. The third says of each
device until when something may last that a command has started and no command stops; mostly there is none. Each line behind them is a
device that a command has set going, and that no acknowledged stop has ended since, the last one first. Two names of one place (a by-id link and /dev/ttyUSB0, a path below slcan, spy:// or alt://) are one lock. A file next to it says when
the device was stopped last. Knows no link's inside.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, NamedTuple

from handctl.errors import HandctlError, LinkError
from handctl.families import FAMILIES
from handctl.link.link_interface import OF_A_HOST, host_in, path_in, scheme_of
from handctl.system import clock, disk, file_locks, processes, serial_ports
from handctl.system.user_folders import HINT, own, own_folder, private_folders

OURS = ("fake://", "replay:")
"""Links that nobody else can reach."""
LAST_STOP_SECONDS = 2.5
"""How long a lock whose file names no process that lives is waited for: a command that was killed leaves it to the child
that stops the device."""


MOST_LASTING = 120.0
"""Seconds: what is noted for longer is of another start of this computer, whose clock began anew."""
LIBRARY = "handctl library"
"""The command of a holder that is no command of handctl, but a program that uses the library."""


FIELDS = 6
"""Of a `Holder` in the lock file."""
MOST_MOVING = 8
"""Devices on one line that are remembered as set going; of more than that the last ones."""
NUMBERS = ("id", "baud", "was")
"""What is told of a `Reached` in whole numbers."""


SILENT = "silent"
"""In the line of a `Reached`."""


class Reached(NamedTuple):
    """A device that a command has reached: its family, and the settings that reach it where they are not the usual ones.

    silent  it was stopped before, and another device on the line was heard then, but not this one
    was     the id with which it was set going, if handctl has given it another one since; else 0
    """

    family: str
    settings: dict[str, Any]
    silent: bool = False
    was: int = 0

    @property
    def key(self) -> tuple[str, int]:
        """What tells it from the others on its line: the family and the id, 1 being that of all as shipped."""
        return self.family, self.settings.get("id", 1)

    @property
    def line(self) -> str:
        """The line for the lock file: the family, and each setting as KEY=VALUE, separated by tabs."""
        more = (f"{key}={' '.join(str(value).split())}" for key, value in self.settings.items())
        notes = [*([SILENT] if self.silent else []), *([f"was={self.was}"] if self.was else [])]
        return "\t".join((self.family, *more, *notes))

    @classmethod
    def of_line(cls, line: str) -> Reached:
        """From `line`; a setting that is damaged is left out."""
        family, *more = line.split("\t")
        pairs = [(key, value) for key, _, value in (one.partition("=") for one in more) if value]
        numbers = {key: int(value) for key, value in pairs if key in NUMBERS and value.isdecimal() and len(value) < 10}
        was = numbers.pop("was", 0)
        return cls(
            family, {**{key: value for key, value in pairs if key not in NUMBERS}, **numbers}, SILENT in more, was
        )


class Holder(NamedTuple):
    """The program that is using a device, from the lock file.

    start   when the process began, as the system counts; "" where it does not tell
    family  "" for a command that has none, as scan
    use     of the device: "reads", "writes" or "stops"; a command that only reads stops nothing when it is ended
    link    the LINK as it was given
    """

    pid: int
    start: str
    family: str
    use: str
    link: str
    command: str

    def __str__(self) -> str:
        return f"`{self.command}` (pid {self.pid})"

    @property
    def line(self) -> str:
        """The line for the lock file: fields separated by tabs."""
        fields = (str(self.pid), self.start, self.family, self.use, self.link, self.command)
        return "\t".join(" ".join(field.split()) for field in fields) + "\n"


class InUse(LinkError):
    """The device is in use. `holder` is None if the lock file does not name it; `path` is the lock file."""

    def __init__(self, link: str, holder: Holder | None, path: str, family: str) -> None:
        who = str(holder) if holder is not None else "another handctl"
        text = f"{link}: the device is in use by {who}"
        super().__init__(text, hint=_way_out(link, holder, family), code="busy")
        self.holder = holder
        self.path = path


class Lock:
    """A held lock; `release` may be called twice. `unrecorded`: why its file does not name the holder. `met`, `going`: see `remembered`."""

    def __init__(self, descriptor: int, path: str) -> None:
        self._descriptor = descriptor
        self._line = "\n"
        self.met, self.going = _reached(descriptor)
        self._until = _until(descriptor)
        self.path = path
        self.unrecorded = ""

    def record(self, holder: Holder) -> None:
        """Write the holder to the file. The lock works even if the disk is full."""
        self._line = holder.line
        try:
            self._write(self._descriptor)
        except OSError as exc:
            self.unrecorded = f"{self.path}: {exc.strerror or exc}"

    def lasts(self, device: tuple[str, int], seconds: float) -> None:
        """Note that something has begun on this device that no command stops, and may last so long; 0 = it is over. For later commands too."""
        self._until[device] = clock.now() + seconds if seconds else 0.0
        with suppress(OSError):
            self._write(self._descriptor)

    def lasting(self, device: tuple[str, int]) -> bool:
        """Whether such a thing may still last there."""
        return 0 < self._until.get(device, 0.0) - clock.now() < MOST_LASTING

    def _write(self, descriptor: int) -> None:
        until = "\t".join(f"{one[0]}\t{one[1]}\t{end!r}" for one, end in self._until.items() if self.lasting(one))
        met = self.met.line if self.met is not None else ""
        rest = "\n".join((met, until, *(one.line for one in self.going))).rstrip("\n")
        text = f"{self._line}{rest}\n" if rest else self._line.lstrip("\n")
        os.ftruncate(descriptor, 0)
        disk.write_at(descriptor, text.encode("utf-8", "replace"), 0)

    def remember(self, device: Reached, *, replied: bool = False) -> None:
        """A command has met this device: whoever asks after the release is told so. It `replied`: this is what reaches it now."""
        self.met = device
        if replied:
            self.going = [device._replace(was=one.was) if one.key == device.key else one for one in self.going]

    def set_going(self, device: Reached) -> None:
        """A command has set this device going. Whoever asks is told so from now on, also if this process is killed."""
        self._keep_going([device, *(one for one in self.going if one.key != device.key)][:MOST_MOVING])

    def at_rest(self, device: Reached) -> None:
        """A stop of this device was acknowledged."""
        self._keep_going([one for one in self.going if one.key != device.key])

    def silent(self, device: tuple[str, int]) -> bool:
        """This device was silent at a stop, and another one was not. The second time it is forgotten; whether it was."""
        forgotten = any(one.silent for one in self.going if one.key == device)
        self._keep_going(
            [
                one._replace(silent=True) if one.key == device else one
                for one in self.going
                if not (one.silent and one.key == device)
            ]
        )
        return forgotten

    def renamed(self, before: tuple[str, int], after: tuple[str, int]) -> None:
        """A device has another id than before; `before` and `after` are keys of a `Reached`."""
        number = {"id": after[1]} if after[1] != 1 else {}

        def at_new_id(one: Reached) -> Reached:
            return one._replace(
                settings={**{key: value for key, value in one.settings.items() if key != "id"}, **number}
            )

        if self.met is not None and self.met.key == before:
            self.met = at_new_id(self.met)
        for one in [one for one in self.going if one.key == before]:
            now = at_new_id(one)._replace(was=one.was or before[1])
            self._keep_going([now if other is one else other for other in self.going if other.key != after])

    def _keep_going(self, going: list[Reached]) -> None:
        if going != self.going:
            self.going = going
            with suppress(OSError):
                self._write(self._descriptor)

    def note_stop(self) -> None:
        """The device is being stopped: no command that was started before may set it going again. Never raises.

        The file has the moment and the process of the last stop, and below those of the last one by another process.
        """
        own_number = str(os.getpid())
        try:
            descriptor = os.open(
                self._stops, os.O_RDWR | os.O_CREAT | disk.NO_LINK | disk.CLOSED_IN_CHILDREN | disk.BINARY, 0o600
            )
        except OSError:
            return
        try:
            others = [line for line in _lines(descriptor) if line.split()[1:] not in ([], [own_number])]
            os.ftruncate(descriptor, 0)
            text = "".join(f"{line}\n" for line in (f"{clock.now():.6f} {own_number}", *others[:1]))
            disk.write_at(descriptor, text.encode("utf-8", "replace"), 0)
        except OSError:
            pass
        finally:
            os.close(descriptor)

    def stopped_since(self, began: float) -> bool:
        """Whether another process has stopped the device after the moment `began` of `clock.now`."""
        try:
            descriptor = os.open(self._stops, os.O_RDONLY | disk.NO_LINK | disk.AT_ONCE | disk.BINARY)
        except OSError:
            return False
        try:
            stops = [line.split() for line in _lines(descriptor)]
        except OSError:
            return False
        finally:
            os.close(descriptor)
        others = [stop[0] for stop in stops if len(stop) == 2 and stop[1] != str(os.getpid())]
        # The clock starts over when the computer does: what is still to come was before that.
        return any(began < float(text) <= clock.now() for text in others if text.replace(".", "", 1).isdecimal())

    @property
    def _stops(self) -> str:
        """The file beside that of the lock that says when the device was stopped."""
        folder, name = os.path.split(self.path)
        return os.path.join(folder, name.replace("lock-", "stopped-", 1))

    @property
    def descriptors(self) -> tuple[int, ...]:
        """The open descriptors of the lock: a process that keeps them open keeps the lock."""
        return (self._descriptor,) if self._descriptor >= 0 else ()

    def release(self) -> None:
        """Let others in. The file stays: taking it away would let two processes lock two files of one name."""
        descriptor, self._descriptor = self._descriptor, -1  # first: a Ctrl-C behind the close must not close it again
        if descriptor >= 0:
            self._line = "\n"
            try:
                self._write(descriptor)
            except OSError:
                pass  # who reads it finds a process that has gone
            finally:
                os.close(descriptor)


def hold(
    link: str,
    command: str,
    tcp_port: int | None = None,
    *,
    family: str = "",
    use: str = "reads",
    patience: float | None = None,
    kept: bool = False,
) -> Lock | None:
    """Lock the device at `link`. The file tells later processes the `command`, its `family` and its `use` (see Holder).

    `tcp_port` is that of a tcp:// without one, `patience` the seconds for a dead holder's last stop, `kept` whether a simulated
    device is that of several commands. None where there is nothing to lock. Raises InUse naming the holder,
    LinkError (code "no-lock") where no lock can be made.
    """
    if (link.startswith(OURS) or scheme_of(link) == "loop") and not kept:
        return None
    descriptor, path = _open(_file_name(canonical(link, tcp_port)))
    until = clock.now() + (LAST_STOP_SECONDS if patience is None else patience)
    while True:
        try:
            file_locks.whole(descriptor)
            break
        except OSError as exc:
            holder = _holder(descriptor)
            if holder is None and clock.now() < until:
                clock.sleep(0.005)
                continue
            os.close(descriptor)
            raise InUse(link, holder, path, family) from exc
    lock = Lock(descriptor, path)
    lock.record(Holder(os.getpid(), processes.began(os.getpid()), family, use, link, command))
    return lock


def remembered(link: str, tcp_port: int | None = None) -> tuple[Reached | None, list[Reached]]:
    """The device at `link` that a command is using, or died with, or met last, None if no file says so; and those that
    commands have set going, and no acknowledged stop has ended since, the last one first.
    """
    name = _file_name(canonical(link, tcp_port))
    for folder in private_folders():
        try:
            path = os.path.join(folder, name)
            descriptor = os.open(path, os.O_RDONLY | disk.NO_LINK | disk.AT_ONCE | disk.BINARY)
        except OSError:
            continue
        try:
            if own(os.fstat(descriptor)) and any(found := _reached(descriptor)):
                return found
        finally:
            os.close(descriptor)
    return None, []


def canonical(link: str, tcp_port: int | None = None) -> str:
    """The place that a LINK leads to, the same for all its names: ``tty 188:0``, ``tcp host:port``, or the LINK."""
    if link.startswith("can:"):
        interface, channel, port = _of_can(link)
        return canonical(port) if interface == "slcan" or port.startswith("/") else f"can {interface}:{channel}"
    if path := path_in(link):
        return serial_ports.place(path)
    scheme = scheme_of(link)
    if link.startswith("usb:") or scheme == "hwgrep":
        from handctl.link.serial import find

        try:
            return serial_ports.place(str(find(link).device))
        except HandctlError:
            return link.casefold()  # opening it will say what is wrong
    if scheme in ("tcp", *OF_A_HOST):
        from handctl.link.tcp import plain_host

        host, port = host_in(link) or ("", "")
        if not host:
            text = link.partition("://")[2].partition("?")[0].rstrip("/").casefold()
            host, colon, port = text.rpartition(":")
            if not colon or not (port.isascii() and port.isdecimal()):
                host, port = text, str(tcp_port or "")
        return f"tcp {plain_host(host)}:{port.lstrip('0')}"
    return link.casefold()


def _of_can(link: str) -> tuple[str, str, str]:
    """The interface, the channel and its port of a CAN LINK."""
    interface, _, channel = link.removeprefix("can:").partition("?")[0].partition(":")
    return interface, channel, channel.partition("@")[0]  # python-can takes what follows for the speed of the port


def held_elsewhere(link: str) -> Iterator[InUse]:
    """The devices that other commands write to by the same name of a port, which leads to another port now: of two adapters without
    a serial number, the name below /dev/serial/by-id is that of the one that was plugged in last."""
    name = _port_named(link)
    if not name:
        return
    here = _file_name(canonical(link))
    for folder in private_folders():
        try:
            files = [file for file in os.listdir(folder) if file.startswith("lock-") and file != here]
        except OSError:
            continue
        for path in (os.path.join(folder, file) for file in files):
            holder = _holder_in(path)
            if holder is not None and holder.use == "writes" and _port_named(holder.link) == name:
                yield InUse(link, holder, path, holder.family)


def _port_named(link: str) -> str:
    """The port of a LINK as it was typed; "" where it names none."""
    port = _of_can(link)[2] if link.startswith("can:") else link
    return port if port.startswith("usb:") else path_in(port)


def _holder_in(path: str) -> Holder | None:
    """Who has written into this lock file: another process, and this user's."""
    try:
        descriptor = os.open(path, os.O_RDONLY | disk.NO_LINK | disk.AT_ONCE | disk.BINARY)
    except OSError:
        return None
    try:
        holder = _holder(descriptor) if own(os.fstat(descriptor)) else None
    except OSError:
        return None
    finally:
        os.close(descriptor)
    return holder if holder is not None and holder.pid != os.getpid() else None


def _file_name(place: str) -> str:
    plain = "".join(char if char.isascii() and char.isalnum() else f"%{ord(char):02X}" for char in place)
    if len(plain) > 200:
        import hashlib

        plain = hashlib.sha256(place.encode("utf-8", "surrogateescape")).hexdigest()
    return f"lock-{plain}"


def _open(name: str) -> tuple[int, str]:
    problem: OSError | None = None
    for folder in private_folders():
        path = os.path.join(folder, name)
        try:
            if not own_folder(folder, make=True):
                continue
            return os.open(
                path, os.O_RDWR | os.O_CREAT | disk.NO_LINK | disk.CLOSED_IN_CHILDREN | disk.BINARY, 0o600
            ), path
        except FileExistsError:
            continue
        except OSError as exc:
            problem = exc
    raise LinkError(
        f"no folder for the lock that keeps two programs from using one device: {', '.join(private_folders())}"
        + (f": {problem.strerror}" if problem is not None else ""),
        hint=HINT,
        code="no-lock",
    ) from problem


def _lines(descriptor: int) -> list[str]:
    return [*disk.read_at(descriptor, 4096, 0).decode("utf-8", "replace").split("\n"), ""]


def _reached(descriptor: int) -> tuple[Reached | None, list[Reached]]:
    """See `remembered`; a family in a file that was damaged may be a word that is none.

    The family of a holder is told before its device was met: of one that died with the lock, too, for it may have moved it.
    """
    try:
        lines = _lines(descriptor)
    except OSError:
        return None, []
    fields = lines[0].split("\t")
    family = fields[2] if len(fields) == FIELDS else ""
    met = Reached.of_line(lines[1])
    if family and family != met.family:
        met = Reached(family, {})
    return met if met.family else None, [Reached.of_line(line) for line in lines[3:] if line][:MOST_MOVING]


def _until(descriptor: int) -> dict[tuple[str, int], float]:
    """Until when something may last on a device that no command stops, on `clock`."""
    try:
        fields = _lines(descriptor)[2].split("\t")
        return {(kind, int(number)): float(end) for kind, number, end in zip(*[iter(fields)] * 3, strict=False)}
    except (OSError, ValueError, IndexError):
        return {}


def _holder(descriptor: int) -> Holder | None:
    """Who wrote into the lock file; None when it died, and its stop goes out, or has not written its own line yet."""
    fields = _lines(descriptor)[0].split("\t")
    if len(fields) != FIELDS or not fields[0].isdecimal() or len(fields[0]) > 10:
        return None
    pid, start, family, use, link, command = fields
    if not processes.lives(int(pid)) or start not in ("", processes.began(int(pid))):
        return None
    return Holder(int(pid), start, family, use, link, command)


def _way_out(link: str, holder: Holder | None, family: str) -> str:
    """What can be done about a device in use, as far as it is true of this holder."""
    where = f"-p {link}"
    if link.startswith("fake://"):
        where = "--fake --can" if link.endswith("?bus=can") else "--fake"
    kind = (holder.family if holder is not None else "") or family
    stops = f"`handctl {f'{kind} ' if kind else ''}stop {where}` stops the device and ends that command"
    if holder is None:
        return f"wait for it, or: {stops}"
    if (
        holder.family in FAMILIES
        and (unbroken := FAMILIES[holder.family].unbroken)
        and holder.command.endswith(unbroken)
    ):
        return "wait until it has ended, and do not interrupt it"
    if holder.use != "reads":
        return f"wait for it, or: {stops}; kill {holder.pid} ends it as its Ctrl-C does"
    return f"wait for it, or: {stops}; it only reads: kill {holder.pid} ends it and stops nothing on the device"
