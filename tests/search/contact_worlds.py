"""The devices of `contact`, family by family: how each differs from the one of its manual, and what may come of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from functools import partial
from typing import Any, NamedTuple

from handctl.devices.aidin.device import outside
from handctl.devices.aidin.parameter_map import FEEDBACK
from handctl.devices.ekso.parameter_map import MESSAGES, Word
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.hand.register_map import BYTE_MAP, DF, TP
from handctl.devices.inspire.register_map import Register
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.sim.ekso.device import crc
from tests.support.odd_devices import odd_aidin, odd_ekso, odd_registers

World = Callable[[], AbstractContextManager[None]]


class Case(NamedTuple):
    """How a device is, and how its result compares with that of the manual's.

    lacks    an item that it lacks
    prints   a quantity and the number that it shows of it, in the unit of its rows
    strange  whether no device of the manual shows such a number
    proved   whether its answers are proved to the byte; else no value may be read, and it is no other device all the same
    options  of the simulator's link
    """

    world: World
    lacks: str = ""
    prints: tuple[str, int | float] | None = None
    strange: bool = False
    proved: bool = True
    options: tuple[str, ...] = ()


Cases = Iterator[tuple[str, Case]]
Change = Callable[[bytes], bytes]

BESIDE: Mapping[str, bytes] = {
    "00": b"\0",
    "FF": b"\xff",
    "CR LF": b"\r\n",
    "text": b"OK\r\n",
    "three zeros": b"\0\0\0",
    "half a header": b"\x90",
}
"""What stands beside a whole frame, before it or behind."""


def beside(odd: Callable[..., AbstractContextManager[None]], more: Mapping[str, bytes] = BESIDE) -> Cases:
    """Frames with something before or behind."""
    for name, text in more.items():
        for when in ("first", "every"):
            yield f"{when} behind {name}", Case(partial(odd, **{when: lambda data, text=text: data + text}))
            yield f"{when} before {name}", Case(partial(odd, **{when: lambda data, text=text: text + data}))
    yield "every twice", Case(partial(odd, every=lambda data: data + data))


# -- EB 90 ------------------------------------------------------------------------------------------------------------


def eb90(head: bytes, number: int, length: int, flag: int, rest: bytes, total: int | None = None) -> bytes:
    """A frame of any kind, with the sum of what is in it unless another is given."""
    inner = bytes([number, length % 256, flag]) + rest
    return head + inner + bytes([(sum(inner) if total is None else total) % 256])


def reads_only(change: Callable[[bytes], bytes]) -> Change:
    """What becomes of answers to reads."""
    return lambda data: change(data) if data[:2] == b"\x90\xeb" and len(data) > 9 else data


EB90: Mapping[str, Change] = {
    "length of the frame": lambda d: eb90(d[:2], d[2], len(d), d[4], d[5:-1]),
    "length of the data": lambda d: eb90(d[:2], d[2], len(d) - 8, d[4], d[5:-1]),
    "length with the sum": lambda d: eb90(d[:2], d[2], d[3] + 1, d[4], d[5:-1]),
    "length 0": lambda d: eb90(d[:2], d[2], 0, d[4], d[5:-1]),
    "length without the flag": lambda d: eb90(d[:2], d[2], d[3] - 1, d[4], d[5:-1]),
    "flag with bit 7": lambda d: eb90(d[:2], d[2], d[3], d[4] | 0x80, d[5:-1]),
    "flag of the write": lambda d: eb90(d[:2], d[2], d[3], d[4] + 1, d[5:-1]),
    "flag 01": lambda d: eb90(d[:2], d[2], d[3], 1, d[5:-1]),
    "sum with the header": lambda d: eb90(d[:2], d[2], d[3], d[4], d[5:-1], sum(d[:-1])),
    "sum negated": lambda d: eb90(d[:2], d[2], d[3], d[4], d[5:-1], -sum(d[2:-1])),
    "sum inverted": lambda d: eb90(d[:2], d[2], d[3], d[4], d[5:-1], ~sum(d[2:-1])),
    "sum left out": lambda d: d[:-1],
    "header of the host": lambda d: b"\xeb\x90" + d[2:],
    "address high byte first": lambda d: eb90(d[:2], d[2], d[3], d[4], d[6:4:-1] + d[7:-1]),
    "address left out": lambda d: eb90(d[:2], d[2], d[3] - 2, d[4], d[7:-1]),
    "address of words": lambda d: eb90(
        d[:2], d[2], d[3], d[4], (int.from_bytes(d[5:7], "little") // 2).to_bytes(2, "little") + d[7:-1]
    ),
    "id 0": lambda d: eb90(d[:2], 0, d[3], d[4], d[5:-1]),
    "id 255": lambda d: eb90(d[:2], 255, d[3], d[4], d[5:-1]),
    "a byte more": lambda d: eb90(d[:2], d[2], d[3] + 1, d[4], d[5:-1] + b"\0"),
    "a byte less": lambda d: eb90(d[:2], d[2], d[3] - 1, d[4], d[5:-2]),
    "a status byte": lambda d: eb90(d[:2], d[2], d[3] + 1, d[4], d[5:7] + b"\0" + d[7:-1]),
}
"""What a firmware may make of the answer to a read."""
ACKS = {name: bytes([byte]) for name, byte in {"00": 0, "02": 2, "FF": 255, "81": 0x81}.items()}


def frames_odd() -> Cases:
    """Answers of another form."""
    yield from beside(odd_registers)
    for name, change in EB90.items():
        yield f"frame {name}", Case(partial(odd_registers, every=reads_only(change)), proved=False)


def numbers_of(register: Register) -> Iterator[int]:
    """On the other side of what is assumed: of the range, of the sign."""
    bits = 8 * register.size
    least, last = (-(1 << bits - 1), (1 << bits - 1) - 1) if register.signed else (0, (1 << bits) - 1)
    wanted = [least, last, -1, 40000]
    if register.low is not None and register.high is not None:
        wanted += [register.to_raw(register.low) - 1, register.to_raw(register.high) + 1]
    yield from dict.fromkeys(number for number in wanted if least <= number <= last)


def items(registers: Iterator[Register], prefix: str = "", **more: Any) -> Cases:
    """Each register missing in turn, and each with other numbers.

    Not on CAN those of one byte: two are asked for there, and of a silence it is not known which one is missing.
    """
    for register in registers:
        span = (register.address, len(register.span))
        name = register.name
        yield f"{prefix}without {name}", Case(partial(odd_registers, without=(span,)), lacks=name, **more)
        if not prefix:
            world = partial(odd_registers, without=(span,), short=True)
            yield f"short of {name}", Case(world, lacks=name, **more)
            for number in numbers_of(register):
                data = (number % (1 << 8 * register.size)).to_bytes(register.size, "little") * register.count
                world, value = partial(odd_registers, holds={register.address: data}), register.from_raw(number)
                strange = not register.allowed(value) or bool(register.bits and value)
                strange &= name != "move_time"  # its range is this tool's own
                yield f"{name} {number}", Case(world, prints=(name, value), strange=strange, **more)


def blocks(least: int = 0, **more: Any) -> Cases:
    """The longest read is shorter; with less than `least` bytes it is not known who it is."""
    for most in (2, 4, 8, 10, 16, 64):
        known = {"lacks": "longer reads"} if most >= least else {"proved": False}
        yield f"most {most}", Case(partial(odd_registers, most=most), **known, **more)
        yield f"most {most} short", Case(partial(odd_registers, most=most, short=True), **known, **more)


def exo() -> Cases:
    yield from frames_odd()
    yield from items(register for register in EXO if register.readable)
    yield from blocks()


def wrist() -> Cases:
    yield from frames_odd()
    yield from items(iter(WRIST))
    yield from blocks()
    can = ("bus=can",)
    yield from items((one for one in WRIST if one.size > 1), "can ", options=can)
    yield from ((f"can {name}", case) for name, case in blocks(options=can))


# -- Modbus -----------------------------------------------------------------------------------------------------------


def rtu(change: Callable[[bytes], bytes]) -> Change:
    """What becomes of unit and PDU."""
    from handctl.sim.hand import device as simulated

    def changed(data: bytes) -> bytes:
        inner = change(data[:-2])
        return inner + simulated.crc(inner)

    return changed


RTU: Mapping[str, Change] = {
    "unit 0": rtu(lambda d: b"\0" + d[1:]),
    "unit 255": rtu(lambda d: b"\xff" + d[1:]),
    "count of words": rtu(lambda d: d[:2] + bytes([d[2] // 2]) + d[3:] if d[1] == 3 else d),
    "function 04": rtu(lambda d: d[:1] + b"\x04" + d[2:] if d[1] == 3 else d),
    "CRC high byte first": lambda d: d[:-2] + d[:-3:-1],
}


def hand() -> Cases:
    yield from frames_odd()
    known = [register for register in BYTE_MAP if register.readable]
    yield from items(register for register in known if DF in register.models)
    yield from blocks(12)
    speaks = {"rtu ": ("speaks=modbus",), "tcp ": ("bus=modbus-tcp", "model=tp"), "can ": ("bus=can",)}
    for prefix, options in speaks.items():
        model = TP if prefix == "tcp " else DF
        mine = [one for one in known if model in one.models and (prefix != "can " or len(one.span) > 1)]
        yield from items(iter(mine), prefix, options=options)
        yield from ((prefix + name, case) for name, case in blocks(12, options=options))
    for code in (1, 3, 4, 7, 8):
        world = partial(odd_registers, without=((1594, 12),), exception=code)
        yield f"rtu exception {code}", Case(world, lacks="current", options=speaks["rtu "])
    for name, change in RTU.items():
        yield f"rtu {name}", Case(partial(odd_registers, every=change), proved=False, options=speaks["rtu "])
    for name, text in BESIDE.items():
        world = partial(odd_registers, every=lambda data, text=text: data + text)
        yield f"rtu every behind {name}", Case(world, options=speaks["rtu "])


# -- EksoNR -----------------------------------------------------------------------------------------------------------


def sealed(data: bytes) -> bytes:
    """With the CRC of the manual."""
    return data + crc(data).to_bytes(2, "big")


EKSO: Mapping[str, Change] = {
    "msgID low byte first": lambda d: sealed(d[:2] + d[3:1:-1] + d[4:-2]),
    "msgID 0": lambda d: sealed(d[:2] + b"\0\0" + d[4:-2]),
    "command with bit 6": lambda d: sealed(bytes([d[0] ^ 0x40]) + d[1:-2]),
    "length in words": lambda d: sealed(d[:1] + bytes([d[1] // 2]) + d[2:-2]),
    "length one more": lambda d: sealed(d[:1] + bytes([d[1] + 1]) + d[2:-2]),
    "length 0": lambda d: sealed(d[:1] + b"\0" + d[2:-2]),
    "CRC low byte first": lambda d: d[:-2] + d[:-3:-1],
    "CRC inverted": lambda d: d[:-2] + bytes(255 - byte for byte in d[-2:]),
    "sum for CRC": lambda d: d[:-2] + (sum(d[:-2]) % 65536).to_bytes(2, "big"),
    "a word more": lambda d: sealed(d[:1] + bytes([d[1] + 2]) + d[2:-2] + b"\0\0"),
    "a word less": lambda d: sealed(d[:1] + bytes([d[1] - 2]) + d[2:-4]),
    "a status word": lambda d: sealed(d[:1] + bytes([d[1] + 2]) + d[2:4] + b"\0\0" + d[4:-2]),
}
SERVICES = {"time": 150, "date": 151, "settings": 152, "data": 153, "feedback": 154}


def ekso() -> Cases:
    yield from beside(odd_ekso)
    for name, change in EKSO.items():
        yield (
            f"frame {name}",
            Case(partial(odd_ekso, every=lambda d, c=change: c(d) if len(d) > 6 else d), proved=False),
        )
    for mode in ("n-4", "n-2", "frame"):
        yield f"answer-length {mode}", Case(odd_ekso, options=(f"answer-length={mode}",))
    yield "time-body 3", Case(odd_ekso, options=("time-body=3",))
    for size in (2, 5, 6, 7, 8):

        def body(command: int, data: bytes, size: int = size) -> bytes:
            return data.ljust(size, b"\0")[:size] if command in (150, 151) else data

        yield f"time-body {size} bytes", Case(partial(odd_ekso, body=body), lacks="time date")
    for name, number in SERVICES.items():
        for how, instead in {"silent": None, "acknowledged": b"", "refused": b"\0\3"}.items():

            def one(command: int, data: bytes, number: int = number, instead: bytes | None = instead) -> bytes | None:
                return instead if command == number else data

            yield f"{name} {how}", Case(partial(odd_ekso, body=one), lacks=name)
    for message, words in MESSAGES.items():
        for word in words:
            for raw in (-32768, 32767, -1):
                world, number = partial(odd_ekso, body=_with(SERVICES[message], word, raw)), word.raw_of(raw)
                strange = bool(word.choices) and number not in word.choices
                yield f"{word.path} {raw}", Case(world, prints=(word.path, word.from_raw(number)), strange=strange)


def _with(number: int, word: Word, raw: int) -> Callable[[int, bytes], bytes]:
    place = 2 * word.word

    def body(command: int, data: bytes) -> bytes:
        new = (raw % 65536).to_bytes(2, "big")
        return data[:place] + new + data[place + 2 :] if command == number else data

    return body


# -- AIDIN-hand -------------------------------------------------------------------------------------------------------

Content = dict[str, Any]
TEXTS: Mapping[str, Callable[[str], str]] = {
    "blanks": lambda t: t.replace(",", " ,  ").replace(":", "\t:\n"),
    "line ends within": lambda t: t.replace(", ", ",\r\n"),
    "behind comma": lambda t: t + ",",
    "behind NUL": lambda t: t + "\0",
    "behind text": lambda t: t + "\r\nOK",
    "behind prompt": lambda t: t + "\r\n> ",
    "before time": lambda t: "[12:30:05.123] " + t,
    "before length": lambda t: f"{len(t)} " + t,
    "before key": lambda t: "feedback: " + t,
    "before BOM": lambda t: "\ufeff" + t,
    "in an array": lambda t: f"[{t}]",
    "single quotes": lambda t: t.replace('"', "'"),
    "comma at the end": lambda t: t.replace("}", ",}"),
    "upper case exponent": lambda t: t.replace("0.0,", "0.0E+00,"),
}
UNPROVED = {"single quotes", "comma at the end"}
CONTENTS: Mapping[str, Callable[[Content], object]] = {
    "order reversed": lambda c: dict(reversed(c.items())),
    "order by name": lambda c: dict(sorted(c.items())),
    "with hand_mode": lambda c: {"hand_mode": 2, **c},
    "with time": lambda c: {**c, "timestamp": 1732650000.25},
    "with text": lambda c: {"device": "AIDIN-hand v2", **c},
    "with null": lambda c: {**c, "error": None},
    "with a list": lambda c: {**c, "temperature": [31] * 15},
    "with an object": lambda c: {**c, "imu": {"roll": 0.1, "pitch": [1, 2]}},
    "whole numbers as 1.0": lambda c: {k: [float(n) for n in v] for k, v in c.items()},
}
NESTED: Mapping[str, Callable[[Content], object]] = {
    "within data": lambda c: {"data": c},
    "within type and data": lambda c: {"type": "feedback", "data": c},
    "keys upper case": lambda c: {k.upper(): v for k, v in c.items()},
    "keys camel case": lambda c: {k.split("_")[0] + "".join(w.capitalize() for w in k.split("_")[1:]): v for k, v in c.items()},
    "keys with prefix": lambda c: {f"hand_{k}": v for k, v in c.items()},
    "fingers in arrays": lambda c: {k: [v[i : i + len(v) // 5] for i in range(0, len(v), len(v) // 5)] for k, v in c.items()},
    "numbers as text": lambda c: {k: [str(n) for n in v] for k, v in c.items()},
    "fingers by name": lambda c: {k: dict(zip("abcde", (v[i::5] for i in range(5)), strict=True)) for k, v in c.items()},
}  # fmt: skip
"""Nothing of it is a value as the manual has them."""


def aidin() -> Cases:
    for name, text in TEXTS.items():
        yield f"text {name}", Case(partial(odd_aidin, text=text), proved=name not in UNPROVED)
    for name, first in {"banner": b"AIDIN-hand v1.2 ready\r\n", "empty object": b"{}\n", "a report": b'{"status":"ok"}\n'}.items():  # fmt: skip
        yield f"first {name}", Case(partial(odd_aidin, first=lambda data, first=first: first + data))
    for name, content in CONTENTS.items():
        yield f"object {name}", Case(partial(odd_aidin, content=content))
    for name, content in NESTED.items():
        yield f"object {name}", Case(partial(odd_aidin, content=content), proved=False)
    for param in FEEDBACK:
        key = param.key

        def changed(new: Callable[[list[Any]], Any], key: str = key) -> World:
            return partial(odd_aidin, content=lambda c: {**c, key: new(c[key])})

        without = partial(odd_aidin, content=lambda c, key=key: {k: v for k, v in c.items() if k != key})
        renamed = partial(odd_aidin, content=lambda c, key=key: {(f"{k}2" if k == key else k): v for k, v in c.items()})
        yield f"without {key}", Case(without, lacks=key)
        yield f"renamed {key}", Case(renamed, lacks=key)
        yield f"null {key}", Case(changed(lambda v: None), proved=False)
        yield f"empty {key}", Case(changed(lambda v: []), proved=False)
        yield f"longer {key}", Case(changed(lambda v: [*v, v[-1]]), proved=False)
        yield f"shorter {key}", Case(changed(lambda v: v[:-1]), proved=False)
        yield f"text {key}", Case(changed(lambda v: " ".join(map(str, v))), proved=False)
        for number in (-1, -100000, 1000000, 1e9):
            world, value = changed(lambda v, n=number: [n] * len(v)), param.from_wire(number)
            strange = any(outside(param, index, value) for index in range(param.count))
            yield f"{key} {number:g}", Case(world, prints=(param.name, value), strange=strange)


WORLDS: Mapping[str, Callable[[], Cases]] = {"exo": exo, "wrist": wrist, "hand": hand, "ekso": ekso, "aidin": aidin}
