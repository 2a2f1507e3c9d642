"""The boot monitor of the simulated BarrettHand, and the RAM image of its firmware (barrett §3.7, §8).

The manual shows the procedure only; the bytes are what is publicly known of the vendor's own downloader. What that
does not say either is our guess, and marked so. Knows bytes, addresses and seconds; the hand itself is in device.py.

    hand   :                                                  at power on, 9600
    host     FF | FF low  high  count  FF data data …  | FF low …
    hand            low  high  count     data data …   |    low …      each echoed, but not the triggers FF

The end of a download has no mark of its own. An image is whole when the client has ended it as download-end says: RESET
after the last record, silence, or the power switch. What is cut off before that leaves no firmware; with silence and the power
switch a monitor cannot tell the one from the other, for which there is image-records.
"""

from __future__ import annotations

from handctl.sim.engine.simulated_device import Random

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.barrett.shared_state import Board

SPEED = 9600
RETENTION = 172800.0  # s that the super capacitor holds the RAM: two days (§3.7)
TRIGGER = 255
SIZE = 65536  # 16-bit addresses
KEPT = 64  # records after which a state file is brought up to date in the middle of a download
TEXT = b"\n\rNo firmware: please download\n\r:"  # invented; the manual says that the hand prompts for it (§8)

OPTIONS = {
    "image": (("valid", "blank"), "firmware in RAM at the first start: valid (default) or blank"),
    "window": ((None, 60.0), "seconds that the boot monitor waits for FF after ':' (default: as boot, our guess)"),
    "echo-triggers": (False, "1: the boot monitor echoes its triggers FF too (default 0)"),
    "retention": ((RETENTION, 1e9), "seconds without power that the RAM survives (default 172800). Twice as long clears it"),
    "decay": (("both", "errors", "blank"), "how the RAM decays then: both (default: bit errors, later blank), errors or blank"),
    "boot-chunk": (("apart", "together"), "':' at once (apart, default), or together with banner and prompt as a serial server hands it on"),
    "banner-gap": ((0.0, 60.0), "seconds between the banner and its prompt (default 0: one chunk)"),
    "monitor-echo": (False, "1: while it waits, the boot monitor echoes bytes that are not a trigger (default 0: it is silent)"),
    "reset-monitor": (False, "1: RESET passes the boot monitor (default 0)"),
    "download-end": (("reset", "quiet", "power"), "what starts a downloaded firmware, beside a power cycle: reset (default: CR, RESET), quiet, power"),
    "download-quiet": ((2.0, 3600.0), "seconds of silence that start it with download-end=quiet (default 2)"),
    "download-version": (None, "what VERS says after a download (default: as before)"),
    "download-at": (None, "where the download faults are: hex address of a data byte (0x2C40) or +N, the N-th byte with an echo. Without this option each byte counts as a request, as for other faults"),
    "image-records": ((0, 0, 1000000), "records with which an image is whole, whatever ends the download (default 0: whole once the download is ended)"),
    "switch": (None, "seconds at which someone turns the power switch, off first: 2,8 is off at 2 and on at 8"),
}  # fmt: skip
FAULTS = {
    "blank-firmware": "the RAM holds no firmware: the hand stays in its boot monitor",
    "wrong-echo": "download: the hand receives, keeps and echoes a wrong byte, which spoils the image",
    "missing-echo": "download: an echo is missing",
    "extra-byte": "download: a byte too many after an echo",
    "monitor-hang": "download: the boot monitor is deaf until a power cycle",
}


class Image:
    """The firmware in RAM: bytes, which of them were written, and what is wrong with it."""

    def __init__(self, blank: bool, needed: int) -> None:
        self.needed = needed
        self.firmware = not blank  # something that can be started, apart from the three flaws below
        self.records = 0  # of the last download; 0: the firmware that was there at the first start, no bytes known
        self.partial = False  # a record has begun and not ended
        self.spoiled = False  # a byte was misheard
        self.decayed = False  # bits are wrong
        self.version: str | None = None  # that VERS tells instead
        self.data = bytearray(SIZE)
        self.written = bytearray(SIZE)

    @property
    def valid(self) -> bool:
        """A program that the monitor starts; a decayed one starts too (§3.7: erratic control)."""
        return self.firmware and not (self.partial or self.spoiled)

    def put(self, address: int, byte: int) -> None:
        self.data[address], self.written[address] = byte, 1

    def end_record(self) -> None:
        self.partial = False
        self.records += 1
        self.firmware = 0 < self.needed <= self.records

    def end(self) -> None:
        """The client has ended the download."""
        self.firmware = self.firmware or (not self.needed and self.records > 0)

    def decay(self, random: Random) -> None:
        """Wrong bits: one in a thousand of the known bytes, one at least."""
        self.decayed = self.firmware
        places = [place for place in range(SIZE) if self.written[place]]
        for _ in range(1 + len(places) // 1000 if places else 0):
            self.data[places[random.between(0, len(places) - 1)]] ^= 1 << random.between(0, 7)

    def ranges(self) -> list[tuple[int, bytes]]:
        """(address, bytes) of each run of written bytes, ascending."""
        runs, place = [], self.written.find(1)
        while place >= 0:
            end = self.written.find(0, place)
            end = SIZE if end < 0 else end
            runs.append((place, bytes(self.data[place:end])))
            place = self.written.find(1, end)
        return runs

    def flat(self) -> bytes:
        """From the lowest written address to the highest, FF between the runs."""
        runs = self.ranges()
        low = runs[0][0] if runs else 0
        out = bytearray()
        for start, data in runs:
            out += b"\xff" * (start - low - len(out)) + data
        return bytes(out)


WAIT, RECORD, LOW, HIGH, COUNT, DATA_TRIGGER, DATA = range(7)


class Monitor:
    """Waits for the first trigger, then takes records; `until` is when it does something by itself."""

    def __init__(self, device: Board) -> None:
        self.device = device
        self.given = given = device.given
        self.window = given["boot"] if given["window"] is None else given["window"]
        self.held = b""  # what comes out with the banner
        self.needed = given["image-records"]
        self.image = Image(given["image"] == "blank", self.needed)
        self.place: tuple[str, int] | None = None
        self.aim(given["download-at"] or "off")
        self.until: float | None = None
        self.began = 0.0  # s, of the power
        self._state = WAIT
        self._fresh = True  # nothing of this download is in RAM yet
        self._count = 0  # bytes with an echo
        self._address = self._left = 0
        self._typed = b""

    def aim(self, text: str) -> None:
        """Where the download faults are; see the option download-at. Raises ValueError."""
        if text == "off":
            self.place = None
            return
        kind, digits, base = ("count", text[1:], 10) if text[:1] == "+" else ("address", text.removeprefix("0x"), 16)
        try:
            number = int(digits, base)
        except ValueError:
            number = -1
        if not digits.isalnum() or not 0 <= number < (SIZE if base == 16 else 1000000):
            raise ValueError(f"download-at {text!r}: use a hex address such as 0x2C40, +N for the N-th echo, or off")
        self.place = kind, number

    # -- power -------------------------------------------------------------------------------------------------------

    def age(self, seconds: float) -> None:
        """So long without power (§3.7)."""
        if seconds <= self.given["retention"]:
            return
        if self.given["decay"] == "blank" or (
            self.given["decay"] == "both" and seconds > 2.0 * self.given["retention"]
        ):
            self.erase()
        else:
            self.image.decay(self.device.random)

    def erase(self) -> None:
        self.image = Image(True, self.needed)

    def power_off(self) -> None:
        """The end of a download where the power switch is that."""
        if self._state == RECORD and self.given["download-end"] == "power":
            self.image.end()

    def start(self) -> None:
        """Power on: the prompt, whatever is in RAM."""
        self.sit()
        if self.given["boot-chunk"] == "together" and self.image.valid:
            self.held = b":"
        else:
            self.device.post(b":")
        self.boot(self.device.now)

    def boot(self, now: float) -> None:
        """The window begins."""
        self.began, self.until = now, now + self.window

    def sit(self) -> None:
        """Waits for the first trigger, for ever."""
        self.device.speed = SPEED
        self.until = None
        self._state, self._fresh, self._count, self._typed = WAIT, True, 0, b""
        self.held = b""

    def expire(self) -> None:
        """The window is over, or a download has been quiet for long enough."""
        self.until = None
        if self._state == RECORD:
            self.image.end()
        if self.image.valid:
            self.device.restart(self.began if self._state == WAIT else self.device.now)
        elif self._state == WAIT:
            self.device.post(TEXT)

    # -- bytes -------------------------------------------------------------------------------------------------------

    def hear(self, byte: int) -> None:
        device = self.device
        if self._state == WAIT and byte != TRIGGER:
            if self.given["monitor-echo"]:
                device.post(bytes([byte]))
            return  # our guess
        device.hits = device.judge()
        if "deaf" in device.hits:
            return
        if self._state == WAIT:  # nothing happens to the firmware before the first data byte (our guess)
            self.until = None
            self._state = RECORD
            self._echo_trigger()
        elif self._state in (RECORD, DATA_TRIGGER):
            self._hear_trigger(byte)
        else:
            self._hear_byte(byte)

    def _echo_trigger(self) -> None:
        if self.given["echo-triggers"]:
            self.device.post(b"\xff")

    def _hear_trigger(self, byte: int) -> None:
        if byte == TRIGGER:
            self.until = None
            self._state, self._typed = (LOW, b"") if self._state == RECORD else (DATA, b"")
            self._echo_trigger()
        elif (
            self._state == RECORD and self.given["download-end"] == "reset"
        ):  # CR and RESET come back like any byte (our guess)
            self._typed = (self._typed + bytes([byte]))[-6:]
            self.device.post(bytes([byte]))
            if self._typed.upper() == b"RESET\r":
                self._typed = b""
                self.expire()

    def _hear_byte(self, byte: int) -> None:
        self._count += 1
        befall = self._befallen()
        if "monitor-hang" in befall:
            self.device.hang()
            return
        if "wrong-echo" in befall:
            byte ^= 64
        self._take(byte, "wrong-echo" in befall)
        if "missing-echo" not in befall:
            extra = bytes([byte ^ 85]) if "extra-byte" in befall else b""
            self.device.post(bytes([byte]) + extra)

    def _befallen(self) -> frozenset[str]:
        """The download faults that befall this byte."""
        if self.place is None:
            return self.device.hits
        kind, number = self.place
        if kind == "count":
            return self.device.faults if number == self._count else frozenset()
        return self.device.faults if self._state == DATA and number == self._address else frozenset()

    def _take(self, byte: int, misheard: bool) -> None:
        """One byte that has an echo."""
        if self._state == LOW:
            self._address = byte
        elif self._state == HIGH:
            self._address += 256 * byte
        elif self._state == COUNT:
            self._left = byte or 256  # a count of 0: our guess
        else:
            self._store(byte)
        if misheard:
            self._begin()
            self.image.spoiled = True
        if self._state != DATA:
            self._state += 1
        elif not self._left:
            self.image.end_record()
            self._state = RECORD
            if self.given["download-end"] == "quiet":
                self.until = self.device.now + self.given["download-quiet"]

    def _begin(self) -> None:
        """The first byte of a download ends what was there."""
        if self._fresh:
            self._fresh = False
            self.erase()
            self.image.version = self.given["download-version"]
            self.device.dirty = True

    def _store(self, byte: int) -> None:
        self._begin()
        if not self.image.partial and self.image.records % KEPT == 0:
            self.device.dirty = True  # while the record is partial: a killed simulator leaves no whole image
        self.image.partial = True
        self.image.put(self._address, byte)
        self._address = (self._address + 1) % SIZE
        self._left -= 1
