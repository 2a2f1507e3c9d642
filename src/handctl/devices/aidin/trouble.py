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
            hint="check the hand with `status`, and check the network. A hand that sends less than once a second needs --exchange stream --timeout S",
        )
    if said is ExchangeMode.STREAM:
        text = f"connected, but the hand has sent nothing for {patience:g} s, and --exchange stream sends no request"
        return NoAnswer(
            f"{name}: {text}", hint="leave --exchange out, so that handctl sends an empty object as a request"
        )
    if not asked:
        return NoAnswer(
            f"{name}: connected, but the hand sends nothing without a request, and a dry run sends none",
            hint="give all values, so that the current position is not needed",
        )
    poll = "an empty object" if way.poll == FIND_OUT.poll else way.poll.decode("ascii")[:60]
    unasked = (
        "sends nothing without a request and does not answer" if said is ExchangeMode.UNKNOWN else "does not answer"
    )
    return NoAnswer(
        f"{name}: connected, but the hand {unasked} {poll}",
        hint="check the port (8000), and that no other client is connected. If the hand works differently, try --exchange stream|poll, --poll-json TEXT or --tx-terminator nul|none. If it only replies to commands, use --exchange command. `stop` is always sent",
    )


def no_feedback(name: str, seen: bytes, *, whole: bool, more: str = "", why: str = "") -> HandctlError:
    """What came, `seen`, is no feedback; b"": only our own object came back. `whole`: it is an object with other keys.

    `more`: "more " where feedback had come before; `why`: what is wrong with an object that was damaged.
    """
    if not seen:
        return ProtocolError(
            f"{name}: only our own object came back, and no feedback",
            hint="check the address and the port: this is an echo server, not the hand",
            code="echo",
        )
    text = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in seen)
    hint = "check the address and the port: this is another server or another kind of hand. The AIDIN-hand sends JSON on TCP port 8000"
    if whole:
        hint = f"this JSON object has no key from the manual: it may be a report from the hand itself. Otherwise {hint}"
    return ProtocolError(
        f"{name}: no {more}feedback from the hand, but {hex_bytes(seen)} ({text}){f': {why}' if why else ''}",
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
    return ProtocolError(f"{where}: {text}", hint="check it with --trace FILE", code=why.code)
