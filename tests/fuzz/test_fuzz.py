"""Every decoder under random, mutated and adversarial streams, of one seed each. Any number of seeds: `tests/search/fuzz.py`."""

from __future__ import annotations

from pathlib import Path

from handctl.families import FAMILIES
from handctl.link import Deadline
from handctl.link.can import CanLink
from tests.fuzz import decoders, texts
from tests.fuzz.decoders import Aidin, Eb90, Ekso, Slcan
from tests.fuzz.devices import Explain, Simulated, SlcanAdapter
from tests.fuzz.modbus import TAKEN, WRITE, Rtu, Tcp
from tests.fuzz.support import Episode, run_episodes
from tests.support.each_row import each_row
from tests.support.virtual import virtual_time

SHORT = 500
FILES = {"configuration": 40, "snapshot": 40, "ekso log": 200, "sim aidin": 120, "sim hand": 250}
"""Where a chunk costs more, there are fewer of them."""
DECODERS = {
    "eb90 sniffing": lambda folder: Eb90(),
    "eb90 replies": lambda folder: Eb90(b"\x90\xeb"),
    "eb90 one reply": lambda folder: Eb90(b"\x90\xeb\x01\x05\x11\xc0\x05"),
    "modbus rtu, a read": lambda folder: Rtu(),
    "modbus rtu, a write": lambda folder: Rtu(WRITE, TAKEN),
    "modbus tcp": lambda folder: Tcp(),
    "ekso": lambda folder: Ekso(),
    "aidin": lambda folder: Aidin(),
    "gcl": lambda folder: decoders.gcl,
    "realtime": lambda folder: decoders.loop,
    "download": lambda folder: decoders.transfer,
    "canreg": lambda folder: decoders.canreg_words,
    "slcan host": lambda folder: Slcan(),
    "slcan adapter": lambda folder: SlcanAdapter(),
    "s-records": lambda folder: texts.s_records,
    "transcript": texts.Transcript,
    "configuration": texts.Configuration,
    "snapshot": texts.Snapshot,
    "ekso log": texts.EksoLog,
    **{f"explain {family}": lambda folder, family=family: Explain(family) for family in FAMILIES},
    **{f"sim {family}": lambda folder, family=family: Simulated(family) for family in FAMILIES},
}


def episode_of(name: str, folder: Path) -> Episode:
    """The episode of a decoder; files go to `folder`."""
    return DECODERS[name](folder)


@each_row("name", DECODERS)
def test_fuzz(name: str, tmp_path: Path) -> None:
    count = FILES.get(name, SHORT)
    with virtual_time():  # python-can waits for an adapter
        run_episodes(episode_of(name, tmp_path), count)


TORN = [b"T1234567\r", b"T12345678\xff\r", b"Tzzzzzzzz0\r", b"T\r", b"D00000001\r"]
IMPOSSIBLE = [b"TFFFFFFFF0\r", b"T20000000100\r", b"T11000001200\r", b"D1100000120403\r"]


@each_row("text", [*TORN, *IMPOSSIBLE])
def test_damaged_text_of_an_adapter_is_passed_over_and_counted(text: bytes) -> None:
    """It is shown as it came, it is nobody's error frame, and the line behind it is read."""
    with virtual_time():
        link = CanLink("can:slcan:loop://", exclusive=False)  # an echo is not an adapter
        link._bus.serialPortOrig.reset_input_buffer()  # type: ignore[attr-defined]
        link._bus.serialPortOrig.write(text)  # type: ignore[attr-defined]
        now = Deadline(lambda: 1.0, 0.0)
        assert link.receive(now) is None
        assert (link.damaged, link.error_frames) == (1, 0)
        assert repr(text)[:-1] in link.damage
        link._bus.serialPortOrig.write(b"T10FF00012A7FE\r")  # type: ignore[attr-defined]
        assert str(link.receive(now)) == "10FF0001 [2] A7 FE"
        assert link.damaged == 1
