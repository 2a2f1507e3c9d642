"""Changing the hand's serial speed with the port following, restarting it, and the EEPROM (barrett §5.2, §5.4.1)."""

from __future__ import annotations

from handctl.devices.barrett.gcl.language import CR, SECONDS, encode
from handctl.devices.barrett.gcl.line import GclLine
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError, UsageError
from handctl.model.param import Step

SETTLE_SECONDS = 1.0
"""The vendor's pause after a speed change."""
BANNER_SECONDS = 5.0
BANNER_TEXT = "BarrettHand Firmware"


def change(line: GclLine, code: int) -> None:
    """`PSET BAUD code`, then the port (dossier 1.2): the echo comes at the old speed, the rest is unusable.

    Raises NoAnswer when the hand answers at neither speed afterwards; CheckFailed is left to the read-back.
    """
    line.connect()
    link, ledger = line.link, line.journal.ledger
    command = f"PSET BAUD {code}"
    old, new = link.baud, code * 100
    data = encode(command)
    line.journal.counters.sent += 1
    link.write(data, link.deadline(2.0))
    echo = b""
    deadline = line.deadline(1.0 + (2 * len(data) * 10 / old if old else 0))
    while data[:-1] not in echo.upper() and not deadline.expired:
        # Never beyond the echo: what follows comes at the new speed.
        chunk = link.read(deadline, max(1, len(data) - 1 - len(echo)))
        if not chunk:
            break
        echo += chunk
    if data[:-1] not in echo.upper():
        line.resynchronise()
        raise ProtocolError(
            f"{link.name}: the echo of {command} differs: {echo.hex(' ').upper()}",
            hint="run `handctl barrett status`, which tries all baud rates: this one may or may not have changed",
            code="echo-differs",
        )
    if link.can_set_baud:
        link.set_baud(new)
    link.sleep(SETTLE_SECONDS)
    line.collect(0.05)
    link.write(CR, link.deadline(2.0))
    answers = f"the hand replies at {new} bit/s"
    if line.prompt_comes():
        if link.can_set_baud:
            ledger.confirm(answers, Step(command, data))
        return
    if link.can_set_baud and old is not None:
        try:
            line.reconnect()
        except (NoAnswer, ProtocolError) as exc:
            text = f"{link.name}: no prompt after {command}, at {new} bit/s or any other baud rate. {exc.text}"
            raise exc.retold(text, code="lost-speed") from exc
        if link.baud == new:
            ledger.confirm(answers, Step(command, data))
            return
        ledger.doubt(f"answers at {link.baud} bit/s", Step(command, data))
        raise DeviceRefused(
            f"{link.name}: the hand did not change to {new} bit/s. It replies at {link.baud} bit/s",
            hint="use a lower baud rate: some hands do not support the higher ones",
            code="baud",
        )
    raise NoAnswer(f"{link.name}: no prompt after {command}", hint="check the baud rate of the device server")


def reset(line: GclLine) -> str:
    """RESET: restart the firmware; its banner. Motors are uninitialised afterwards (barrett §5.2.4)."""
    line.connect()
    link = line.link
    before = link.baud
    line.journal.counters.sent += 1
    link.write(encode("RESET"), link.deadline(2.0))
    came = line.collect(BANNER_SECONDS)
    if came.upper().strip(b"\r\n :") in (b"", b"RESET"):  # nothing but the echo: it is still starting
        came += line.collect(SECONDS["reset"] - BANNER_SECONDS)
    text = came.decode("ascii", "replace")
    banner = "\n".join(part.strip() for part in text.replace("\r", "\n").split("\n") if part.strip(" =>:\0"))
    banner = banner.removeprefix("RESET").strip(" :\n")  # a hand that has just started may print ":" first
    line.reconnect()
    if BANNER_TEXT in banner or link.baud != before:  # a banner at another speed is unreadable
        line.journal.ledger.confirm("its banner arrived, and it replies", Step("RESET", encode("RESET")))
    else:
        raise ProtocolError(
            f"{link.name}: the banner does not say {BANNER_TEXT!r}: {banner!r}. It is not known whether the hand restarted",
            hint="check with `handctl barrett status`: after a restart the motors are not initialized",
            code="banner",
        )
    line.journal.info("uninitialized", "the motors are no longer initialized", hint="`handctl barrett init`")
    return banner


def code_of(rate: int) -> int:
    """BAUD value of a speed in bit/s. Raises UsageError."""
    if rate % 100 or rate // 100 not in (6, 12, 24, 48, 96, 192, 384):
        raise UsageError(
            f"{rate} bit/s is not a baud rate of this hand",
            hint="use 600, 1200, 2400, 4800, 9600, 19200 or 38400 (barrett §5.4.1). Nothing was sent.",
        )
    return rate // 100
