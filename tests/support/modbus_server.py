"""A public Modbus server (pymodbus) that holds the golden RH56 hand: on TCP, and on a serial line made of two ptys.

pymodbus knows no hand: registers and values are literals of the RH56 dossier (§2.2, §3, §10).
"""

from __future__ import annotations

import asyncio
import os
import select
import threading
import tty
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

SIX = 6
DF_WORDS = {
    1020: (901, 902, 903, 904, 905, 906),
    1032: (701, 702, 703, 704, 705, 706),
    1044: (501, 502, 503, 504, 505, 506),
    1472: (558,),
    1474: (111, 222, 333, 444, 555, 666),
    1486: (-1,) * SIX,
    1498: (401, 402, 403, 404, 405, 406),
    1522: (601, 602, 603, 604, 605, 606),
    1534: (211, 322, 433, 544, 655, 766),
    1546: (110, 220, 330, 440, 550, 660),
    1582: (-11, 12, -13, 14, -15, 16),
    1594: (21, -22, 23, 24, 25, 26),
}
DF_BYTES: dict[int, tuple[int, ...]] = {
    1000: (1,),
    1606: (0,) * SIX,
    1612: (2, 1, 2, 3, 2, 0),
    1618: (31, 32, 33, 34, 35, 36),
}
TP_BYTES = {1700: (192, 168, 11, 210)}
F1_WORDS = {
    1000: (1,),
    1016: (901, 902, 903, 904, 905, 906),
    1022: (701, 702, 703, 704, 705, 706),
    1028: (501, 502, 503, 504, 505, 506),
    1034: (111, 222, 333, 444, 555, 666),
    1040: (-1,) * SIX,
    1046: (401, 402, 403, 404, 405, 406),
    1052: (601, 602, 603, 604, 605, 606),
    1058: (211, 322, 433, 544, 655, 766),
    1064: (1010, 1120, 1230, 1340, 1150, 1560),
    1070: (-11, 12, -13, 14, -15, 16),
    1076: (21, -22, 23, 24, 25, 26),
    1082: (0,) * SIX,
    1088: (2, 1, 2, 3, 2, 0),
    1094: (31, 32, 33, 34, 35, 36),
}
SIZE = 6000
ANY = 0
"""The unit with which pymodbus answers to all: a hand does so on TCP (rh56 §2.3)."""


class Memory:
    """The bytes of a hand, and what its registers read. DF and TP: the word at a is the bytes a and a+1 (rh56 §2.2).

    So `count` registers from a on are the words at a, a+2, a+4 ... F1 and DG2 count words.
    """

    def __init__(self, model: str) -> None:
        self._per = 2 if model == "f1" else 1
        words = F1_WORDS if model == "f1" else DF_WORDS
        self._bytes = bytearray(2 * SIZE)
        for start, values in words.items():
            if model != "tp" or start not in (1020, 1472):
                self.put(start, values)
        if model == "tp":
            self.put(3000, range(1062))
        singles = {"df": DF_BYTES, "tp": {**DF_BYTES, **TP_BYTES}}.get(model, {})
        for start, values in singles.items():
            self._bytes[start : start + len(values)] = bytes(values)

    def put(self, address: int, values: Iterable[int]) -> None:
        place = address * self._per
        for value in values:
            self._bytes[place : place + 2] = (value & 0xFFFF).to_bytes(2, "little")
            place += 2

    def registers(self, address: int, count: int) -> list[int]:
        place = address * self._per
        return [int.from_bytes(self._bytes[at : at + 2], "little") for at in range(place, place + 2 * count, 2)]


def _device(model: str, unit: int) -> Any:
    """pymodbus keeps plain registers; each request is shown, and taken, as the hand's memory has it."""
    from pymodbus.simulator import DataType, SimData, SimDevice

    memory = Memory(model)

    async def act(
        _function: int, first: int, address: int, count: int, registers: list[int], written: list[int] | None
    ) -> None:
        if written is not None:
            memory.put(address, written)
        registers[address - first : address - first + count] = memory.registers(address, count)

    return SimDevice(unit, SimData(0, values=[0] * SIZE, datatype=DataType.REGISTERS), action=act)


@contextmanager
def _running(make: Any) -> Iterator[Any]:
    """The server that `make` makes, in the event loop of a thread of its own."""
    loop, ready, made = asyncio.new_event_loop(), threading.Event(), list[Any]()

    async def serve() -> None:
        server = make()
        made.append(server)
        await server.listen()
        ready.set()
        await server.serving

    def run() -> None:
        asyncio.set_event_loop(loop)
        loop.run_until_complete(serve())

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert ready.wait(30), "the server did not begin"
    try:
        yield made[0]
    finally:
        asyncio.run_coroutine_threadsafe(made[0].shutdown(), loop).result(30)
        thread.join(30)
        loop.close()


@contextmanager
def over_tcp(model: str) -> Iterator[str]:
    """The LINK of a hand of this generation behind Modbus TCP."""
    from pymodbus.server import ModbusTcpServer

    with _running(lambda: ModbusTcpServer(_device(model, ANY), address=("127.0.0.1", 0))) as server:
        yield f"tcp://127.0.0.1:{server.transport.sockets[0].getsockname()[1]}"


@contextmanager
def over_rtu(model: str) -> Iterator[str]:
    """The LINK of a hand of this generation behind Modbus RTU: our end of a line, the server at the other."""
    from pymodbus.server import ModbusSerialServer

    with (
        _line() as (ours, theirs),
        _running(lambda: ModbusSerialServer(_device(model, 1), port=theirs, baudrate=115200)),
    ):
        yield ours


@contextmanager
def _line() -> Iterator[tuple[str, str]]:
    """Two serial ports, connected."""
    ends = [os.openpty() for _ in range(2)]
    for _, port in ends:
        tty.setraw(port)
    masters = [master for master, _ in ends]
    stop, stopped = os.pipe()

    def carry() -> None:
        while stop not in (readable := select.select([*masters, stop], [], [])[0]):
            for master in readable:
                os.write(masters[1 - masters.index(master)], os.read(master, 4096))

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        yield os.ttyname(ends[0][1]), os.ttyname(ends[1][1])
    finally:
        os.close(stopped)
        thread.join(30)
        for descriptor in (stop, *(one for pair in ends for one in pair)):
            os.close(descriptor)
