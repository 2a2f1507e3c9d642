"""What to say of an AIDIN-hand that sends nothing, something else, or a number that is none. Knows no link."""

from __future__ import annotations

from handctl.devices.aidin.feedback import Wire
from handctl.devices.aidin.map import AidinParam
from handctl.devices.aidin.messages import WrongNumbers
from handctl.devices.aidin.way import FIND_OUT, ExchangeMode, Way
from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.model.param import Element, Number
from handctl.model.result import hex_bytes


def silent(name: str, way: Way, patience: float, *, asked: bool, stopped: bool) -> NoAnswer:
    """Nothing has come for `patience` seconds; `stopped`: it had sent feedback before; `asked`: it was asked, too."""
    said = way.exchange
    if stopped:
        return NoAnswer(
            f"{name}: the hand has stopped sending feedback",
            hint="look at the hand with `status` and check the network. A hand that sends less than once a second needs "
            "--exchange stream --timeout S",
        )
    if said is ExchangeMode.STREAM:
        text = f"connected, the hand has said nothing for {patience:g} s, and --exchange stream asks nothing"
        return NoAnswer(f"{name}: {text}", hint="leave --exchange out: then the hand is asked with an empty object")
    if not asked:
        return NoAnswer(
            f"{name}: connected, the hand sends nothing unasked, and a dry run asks nothing",
            hint="give the whole vector: then nothing needs to be known",
        )
    poll = "an empty object" if way.poll == FIND_OUT.poll else way.poll.decode("ascii")[:60]
    unasked = "sends nothing unasked and does not answer" if said is ExchangeMode.UNKNOWN else "does not answer"
    return NoAnswer(
        f"{name}: connected, the hand {unasked} {poll}",
        hint="is it the hand's port (8000)? Another client may hold it. If it speaks otherwise: --exchange stream|poll, "
        "--poll-json TEXT, --tx-terminator nul|none. One that answers commands only: --exchange command. `stop` is always sent",
    )


def no_feedback(name: str, seen: bytes, *, whole: bool, more: str = "", why: str = "") -> HandctlError:
    """What came, `seen`, is no feedback; b"": only our own object came back. `whole`: it is an object with other keys.

    `more`: "more " where feedback had come before; `why`: what is wrong with an object that was damaged.
    """
    if not seen:
        return ProtocolError(
            f"{name}: only our own object came back, no feedback",
            hint="check address and port: this is an echo server, not the hand",
            code="echo",
        )
    text = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in seen)
    hint = "check address and port: it is another server or another kind of hand. The AIDIN-hand speaks JSON on TCP port 8000"
    if whole:
        hint = f"a JSON object without any key of the manual: what the hand reports in its own words, or {hint}"
    return ProtocolError(
        f"{name}: no {more}feedback of the hand came, but {hex_bytes(seen)} ({text}){f': {why}' if why else ''}",
        hint=hint,
        code="garbage",
        came=seen,
    )


def named(where: str, param: AidinParam, found: Wire | ProtocolError) -> Wire | ProtocolError:
    """What came for a key; an error says which hand, which key, and which of its elements as `get` takes them."""
    if isinstance(found, WrongNumbers):
        texts = (f"{Element(param, place).full_name} {exc.text}" for place, exc in found.wrong.items())
        return _spelled(where, "; ".join(texts), found)
    return _spelled(where, f"{param.key}: {found.text}", found) if isinstance(found, ProtocolError) else found


def number_of(where: str, element: Element, param: AidinParam, found: Wire | ProtocolError) -> Number | ProtocolError:
    """The number of one element; an error only where it concerns this one."""
    if isinstance(found, WrongNumbers):
        wrong, number = found.wrong.get(element.index), found.numbers[element.index]
        if wrong is None and number is not None:
            return number
        return _spelled(where, f"{element.full_name} {wrong.text if wrong else found.text}", wrong or found)
    found = named(where, param, found)
    return found if isinstance(found, ProtocolError) else found[element.index]


def _spelled(where: str, text: str, why: ProtocolError) -> ProtocolError:
    return ProtocolError(f"{where}: {text}", hint="look at it with --trace FILE", code=why.code)
