"""Load firmware (barrett §3.7): ask the operator to power-cycle the hand, send every record, check that the hand replies again.

The order and the waits are the dossier's (7.3). Only RAM is written: parameters are in EEPROM, and a hand that was left
half-loaded is repaired by doing it again from the start.
"""

from __future__ import annotations

import re

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.firmware.srecords import READY, SELECT, TRIGGER, Firmware, Transfer
from handctl.devices.barrett.gcl.codec import BANNER, CR, PROMPT, has_prompt
from handctl.devices.barrett.gcl.connect_table import MONITOR_SPEED
from handctl.devices.barrett.gcl.line import SLOW_ADAPTER
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.devices.barrett.state_files import forget_download, note_download
from handctl.devices.barrett.status_and_parameter_views import row_of
from handctl.errors import (
    Aftermath,
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Hint,
    Interrupted,
    LinkError,
    NoAnswer,
    NotRunning,
    ProtocolError,
)
from handctl.link import ByteLink
from handctl.model.prompts import InterruptCount, Prompts
from handctl.model.result import Row, Table

READY_SECONDS = 120.0
STILL_ON_SECONDS = 10.0
"""The same for a hand that is on while nobody can be asked to switch it off: a script may do it."""
ECHO_SECONDS = 1.0
LISTEN_SECONDS = 0.05
PROMPT_SECONDS = 5.0
SENT_LAST = CR + b"\nRESET" + READY
STEP_PERCENT = 10
TEXT_GAP = 0.1
"""A `:` this long after other characters is the monitor's, not part of a text."""
OFF = (
    "Switch the hand's power supply OFF. Do not pull any cable. "
    "Press Enter when it has been off for 5 seconds (barrett §3.7)."
)
ON = "Now switch the power supply ON. The download then starts automatically."
KEEP_ON = "Keep the power on."
"""CommandLine first in every progress line of a download: half a firmware is none."""
CYCLE = "Switch the power supply OFF, wait 5 seconds, switch it ON."
MISSED = "The hand started its old firmware, so it was too late for the download. Switch it off and on again."
AGAIN = "switch the hand off and on, then load the firmware again"
HALF = "the firmware in the hand is incomplete. Switch the hand off, do not move it, and load the whole file again"
DOWNLOADS = "a firmware download is running: the boot monitor moves nothing, and would read a stop as firmware"
"""Why nobody else can have the device stopped meanwhile."""
WHOLE = "no data was sent, so the firmware has not changed. Switch the hand off and on, and check it with `handctl barrett version`"


class Loader:
    """One download into one hand."""

    def __init__(
        self, hand: BarrettHand, prompts: Prompts, firmware: Firmware, *, window: int, expect: str | None
    ) -> None:
        self.hand = hand
        self.firmware = firmware
        self.expect = expect
        self._guide = prompts
        self._window = window
        self._echoes = False  # whether the monitor echoes its triggers
        self._sent = 0
        self._begun = False  # a data byte went out: what was in the hand is gone
        self._where = "the first record"
        self._echo_seconds = 0.0
        self._still_on = False

    @property
    def link(self) -> ByteLink:
        """The hand's line."""
        return self.hand.line.link

    def run(self) -> Table:
        """The whole procedure. Raises NoAnswer, ProtocolError, LinkError, Interrupted with the address it stopped at."""
        before = self._version_before()
        ledger = self.hand.journal.ledger
        begun = ledger.mark
        image = f"the image {self.firmware.name}, {self.firmware.size} bytes, to the boot monitor"
        while True:
            with ledger.one_step(image, AGAIN):
                self._power_on()
            try:
                with ledger.one_step(image, AGAIN):
                    self._send_all()
                ledger.confirm("every byte was echoed", since=begun)
                break
            except LinkError as exc:
                reached = f"stopped at {self._where}, {self._sent} of {self.firmware.size} bytes"
                exc.add_aftermath(Aftermath(reached, self._left))
                raise
            except (NoAnswer, ProtocolError) as exc:
                exc.add_aftermath(Aftermath(hint=self._left))
                self._guide.done()
                self.hand.line.drain()
                if not (self._guide.interactive and self._guide.ask(f"{exc.text}. Start again with the power off", "")):
                    raise
        after = self._come_back()
        return self._verdict(before, after)

    @property
    def _left(self) -> str:
        """What is in the hand now, and what to do."""
        return HALF if self._begun else WHOLE

    # -- before --------------------------------------------------------------------------------------------------

    def _version_before(self) -> str:
        """What the hand runs now; "" when nothing answers, as of a hand without firmware."""
        self._guide.say("Checking the current firmware. If there is none, this takes a few seconds.")
        try:
            return self.hand.version()
        except HandctlError as exc:
            if exc.exit_code == 3:
                raise
            if isinstance(exc, NotRunning):  # it was known without a question, or its boot monitor replied
                self.hand.journal.info("not-running", exc.text)
            else:
                text = "no firmware replied before the download: the hand may have none"
                self.hand.journal.info("silent-before", text)
            return ""

    def _power_on(self) -> None:
        """Power off, X, power on, `:`, the first trigger (7.3, steps 3 to 6)."""
        link = self.link
        if link.can_set_baud and link.baud != MONITOR_SPEED:
            link.set_baud(MONITOR_SPEED)
        if link.fake:
            link.write(SELECT, link.deadline(1.0))
            link.power_cycle()
            self._guide.say("Switching the simulated hand off and on.")
        else:
            self._ask_for_power()
        self._await_monitor()
        link.write(TRIGGER, link.deadline(1.0))

    def _ask_for_power(self) -> None:
        link = self.link
        for _ in range(5):
            self._guide.wait_for_enter(OFF)
            self.hand.line.drain()
            link.write(SELECT, link.deadline(1.0))
            self._still_on = SELECT in self._listen(0.2)
            if not self._guide.interactive or not self._still_on:
                break
            self._guide.instruct("The hand still replies, so its power is on.")
        self._guide.instruct(ON)
        link.event("power cycle for the download")

    def _await_monitor(self) -> None:
        """Wait for `:` with nothing after it. Text means that the old firmware has started, so it is too late."""
        link = self.link
        allowed = STILL_ON_SECONDS if self._still_on else READY_SECONDS
        bound = self.hand.line.bound
        cut = bound is not None and bound.remaining < allowed
        deadline = self.hand.line.deadline(allowed)
        seconds, missed = deadline.remaining, False
        heard, tail, at = b"", b"", link.now()  # `tail`: what came just before, without a pause
        while not deadline.expired:
            left = deadline.remaining
            self._guide.progress(f"Waiting for the boot monitor, {left:.0f} s left.")
            chunk = link.read(link.deadline(min(left, 1.0)))
            if link.now() - at > TEXT_GAP:
                tail = b""
            if chunk:
                at = link.now()
            for place, byte in enumerate(chunk):
                before = (tail + chunk[:place])[-1:]
                if byte == READY[0] and not (before and 32 < before[0] < 127):
                    chunk += b"" if chunk[place + 1 :] else self._listen(LISTEN_SECONDS)
                    if not chunk[place + 1 :].strip(READY + b"\0\r\n"):
                        self._guide.done()
                        self.hand.journal.counters.stray_bytes += len(heard) + len(chunk) - 1
                        return
                    break  # a text follows: the banner of the firmware that starts, no invitation
            heard, tail = (heard + chunk)[-256:], (tail + chunk)[-1:]
            if PROMPT in heard:
                self._guide.instruct(MISSED)
                heard, missed = b"", True
        self._guide.done()
        came = f", received {heard[:48].hex(' ').upper()}" if heard else ""
        if self._still_on and not missed and not cut:
            raise DeviceRefused(
                f"{link.name}: the hand is on, and was not switched off within {seconds:.0f} s",
                hint="switch its power off for 5 seconds, run this again, and switch it on while handctl waits. Nothing was loaded",
                code="still-on",
            )
        error = NoAnswer(
            f"{link.name}: no boot monitor (:) within {seconds:.0f} s{' (--deadline)' if cut else ''}{came}",
            hint=f"{MISSED} Nothing was loaded."
            if missed
            else "check the cable and the port, then switch the power supply off for 5 seconds and on again. Nothing was loaded.",
            code="no-monitor",
        )
        error.bounded = cut
        raise error

    # -- sending -------------------------------------------------------------------------------------------------

    def _send_all(self) -> None:
        link = self.link
        self._sent = 0
        start = link.now()
        told = 0
        self.hand.line.bound = None  # once begun it is finished: half a firmware is none
        self._guide.unstoppable = DOWNLOADS
        with self._guide.count_interrupts() as presses:
            warned = 0
            for number, record in enumerate(self.firmware.records):
                self._send(
                    Transfer(record, window=1 if number == 0 else self._window, triggers_echo=self._echoes), number
                )
                self._sent += len(record.data)
                if presses.count > warned:
                    warned = presses.count
                    self._on_press(presses, record.address)
                told = self._tell(told, link.now() - start)
                if number == 0:
                    self._judge_pace()
        self._guide.unstoppable = ""
        forget_download(link)
        self._guide.done()
        self._guide.say(f"{self._sent} bytes sent and echoed in {link.now() - start:.1f} s.")

    def _send(self, transfer: Transfer, number: int) -> None:
        link = self.link
        begun = link.now()
        while not transfer.done:
            self._where = transfer.where
            if number == 0 and transfer.between:
                self._listen_for_trigger(transfer)
            out = transfer.take()
            if out and transfer.in_data and not self._begun:
                self._begun = True
                note_download(link)
            deadline = link.deadline(ECHO_SECONDS + self.hand.line.wire_seconds(len(out) + 1)).earlier(
                self.hand.line.bound
            )
            if out:
                link.write(out, deadline)
                self.hand.journal.counters.sent += len(out)
            came = link.read(deadline, 64)
            if not came:
                raise NoAnswer(
                    f"{link.name}: stopped at {transfer.where}: no echo of {transfer.awaited:02X}",
                    hint=AGAIN,
                    code="no-echo",
                )
            self.hand.journal.counters.received += len(came)
            try:
                transfer.feed(came)
            except ProtocolError as exc:
                self.hand.journal.counters.bad_frames += 1
                more = came + self._listen(0.2)
                slower = "leave --window out, then run the download again" if self._window > 1 else AGAIN
                text, code = exc.text, exc.code
                if READY in came or BANNER in more.upper():
                    text, code = f"{text}: the hand restarted because of its power or its cable", "restarted"
                raise ProtocolError(f"{link.name}: stopped {text}", hint=slower, code=code) from exc
        if number == 0:
            self._echo_seconds = (link.now() - begun - 2 * LISTEN_SECONDS) / (3 + len(self.firmware.records[0].data))

    def _listen_for_trigger(self, transfer: Transfer) -> None:
        """The first record's triggers go out alone: FF coming back means that this monitor echoes them."""
        link = self.link
        link.write(transfer.trigger(), link.deadline(1.0))
        came = self._listen(LISTEN_SECONDS)
        if came.strip(TRIGGER):
            raise ProtocolError(
                f"{link.name}: stopped at {transfer.where}: {came[:16].hex(' ').upper()} arrived after the trigger FF",
                hint=AGAIN,
                code="extra-byte",
            )
        if came:
            self._echoes = transfer.triggers_echo = True

    def _listen(self, seconds: float) -> bytes:
        """What comes within `seconds`."""
        deadline = self.link.deadline(seconds)
        came = b""
        while not deadline.expired and len(came) < 4096:
            came += self.link.read(deadline)
        return came

    def _on_press(self, presses: InterruptCount, address: int) -> None:
        self._guide.done()
        if presses.count == 1:
            self._guide.instruct(
                "The download continues. Press Ctrl-C again to stop it, which leaves the hand without firmware."
            )
            return
        warning = "The vendor warns that an interrupted download may damage the hand: leave it off until you can load the file"
        raise Interrupted(
            f"interrupted after {address:04X}h, {self._sent} of {self.firmware.size} bytes",
            left=Aftermath(f"{HALF}. {warning}"),
        )

    def _tell(self, told: int, seconds: float) -> int:
        """Progress: a bar on a terminal, a line every 10 % elsewhere."""
        part = self._sent / self.firmware.size
        rate = self._sent / seconds if seconds > 0 else 0.0
        left = (self.firmware.size - self._sent) / rate if rate else 0.0
        text = f"{part:4.0%}  {left:.0f} s left  {self._sent} of {self.firmware.size} bytes  {rate:.0f} bytes/s"
        if self._guide.moving:
            filled = int(part * 10)
            self._guide.progress(f"[{'#' * filled}{'.' * (10 - filled)}] {text}", KEEP_ON)
        elif part * 100 >= told + STEP_PERCENT:
            told = int(part * 100) // STEP_PERCENT * STEP_PERCENT
            self._guide.say(text)
        return told

    def _judge_pace(self) -> None:
        """After the first record: what an echo costs, and what that makes of the whole."""
        wire = 2 * self.hand.line.wire_seconds(1)
        extra = self._echo_seconds - wire
        if self.link.baud and extra > 0.004:
            total = self.firmware.seconds + extra * (self.firmware.size + 3 * len(self.firmware.records)) / self._window
            self.hand.journal.warn(
                "slow-adapter",
                f"each echo takes {extra * 1000:.0f} ms longer than its bytes: about {total:.0f} s in all",
                hint=SLOW_ADAPTER,
            )

    # -- after ---------------------------------------------------------------------------------------------------

    def _come_back(self) -> str:
        """Find the new firmware: its prompt, CR, RESET, every speed, a power cycle (7.3, steps 9 to 11)."""
        line, link = self.hand.line, self.link
        heard = b""
        for send, seconds in ((b"", PROMPT_SECONDS), (CR, 1.0), (b"RESET" + CR, PROMPT_SECONDS)):
            if send:
                link.write(send, link.deadline(1.0))
            self._guide.progress("Waiting for the new firmware.", KEEP_ON)
            came = line.until_prompt(seconds)
            heard += came
            if has_prompt(came):
                break
        self._guide.done()
        if heard.strip(SENT_LAST):
            try:
                line.reconnect()
                return self.hand.version()
            except (NoAnswer, ProtocolError):
                pass
        # Nothing but perhaps an echo: the monitor may still wait for a record. Looking for other speeds now could send
        # it a byte that it takes for a trigger, and spoil what was just loaded (dossier 1.5): power first.
        self._cycle_again()
        return self.hand.version()

    def _cycle_again(self) -> None:
        line, link = self.hand.line, self.link
        if not link.power_cycle() and not self._guide.wait_for_enter(
            f"No firmware has replied yet. {CYCLE} Then press Enter."
        ):
            self._guide.say(f"Waiting up to {READY_SECONDS:.0f} s.")
            deadline = line.deadline(READY_SECONDS)
            while not deadline.expired and not link.read(link.deadline(1.0)):
                self._guide.progress(f"Waiting for a power cycle, {deadline.remaining:.0f} s left.")
            self._guide.done()
        line.until_prompt(PROMPT_SECONDS)  # the monitor's window must be over before a byte is sent
        try:
            line.reconnect()
        except (NoAnswer, ProtocolError) as exc:
            text = f"every byte was echoed, but no firmware replies: {exc.text}"
            raise exc.reworded(text, hint=Hint(f"{CYCLE} Then run {{}}", "barrett version"), code="not-alive") from exc

    def _verdict(self, before: str, after: str) -> Table:
        readings = self.hand.read(BARRETT.elements("S", "SN", "OTEMP", "BAUD"))
        rows: list[Row] = [
            row_of("file", None, None, self.firmware.name, None),
            row_of("sha256", None, None, self.firmware.sha256, None),
            row_of("image_sha256", None, None, self.firmware.image_sha256, None),
            row_of("bytes", None, None, self.firmware.size, None),
            row_of("version_before", None, None, before or None, None),
            row_of("firmware", "VERS", None, after, None),
            *(self.hand.row(reading) for reading in readings),
        ]
        found = version_in(after)
        wanted = self.expect or version_in(self.firmware.name) or version_in(self.firmware.header)
        table = Table(rows=rows)
        if wanted is not None and found != wanted:
            text = f"{self.link.name}: the hand reports {after!r}, expected version {wanted}"
            if self.expect is not None:
                hint = "check the file: it may be the wrong one, or the hand still has its old firmware"
                table.failure = CheckFailed(text, hint=hint, code="version")
            else:
                # The manual itself is not sure which file is which version (§1.1.2 against T1): a remark only.
                self.hand.journal.warn("version", f"{text} by the file's name", hint="use --expect to check this")
        self.hand.journal.info("init", Hint("run {} before any movement", "barrett init"))
        return table


def version_in(text: str) -> str | None:
    """``BarrettHand Firmware v4_34.S19`` -> ``4.34``."""
    found = re.search(r"(\d+)[._](\d+)", text)
    return f"{found[1]}.{found[2]}" if found else None
