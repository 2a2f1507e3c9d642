"""What a user says about an RH56 hand before handctl asks it: --model, --protocol and the wire. Sends nothing."""

from __future__ import annotations

from typing import Any

from handctl.devices.inspire.hand.register_map import BYTE_MAP, MAPS, MODELS, model_of
from handctl.devices.inspire.modbus_frames import RTU, RTU_SPEED, TCP, mode_of
from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.link import ByteLink
from handctl.model.command_settings import Settings
from handctl.model.param import ParamMap
from handctl.number_parsing import number_in

HERE = ("127.0.0.1", "localhost", "[::1]")
"""This machine, where simulators are served."""


def typed_model(settings: Settings) -> str | None:
    """The generation that --model or the named device says. Raises UsageError for a label that is not known."""
    text = settings.own.get("model")
    if text is None:
        return None
    model = model_of(text)
    if model is None:
        raise UsageError(
            f"--model {text}: unknown model",
            hint=f"use {', '.join(MODELS)}, or the name on the label, such as RH56DFTP",
        )
    return model


def check_model_and_port(settings: Settings) -> None:
    """Raise UsageError for an unknown model, and for Modbus TCP on a port not known to be a hand's.

    Bytes to another port may reach a serial line. There function 03 is ^C, which ends a movement of a BarrettHand.
    """
    typed_model(settings)
    link = settings.port or ""
    if not link.startswith("tcp://") or settings.own.get("protocol") == "modbus":
        return
    host, colon, port = link.removeprefix("tcp://").rstrip("/").rpartition(":")
    if colon and number_in(port) not in (None, FAMILIES["hand"].tcp_port) and host not in HERE:
        raise UsageError(
            f"{link}: a hand uses Modbus TCP port {FAMILIES['hand'].tcp_port}. Another port may lead to a serial line",
            hint="add --protocol modbus if a hand replies there (for doctor, HANDCTL_PROTOCOL=modbus), or give socket://HOST:PORT for "
            "a serial line",
        )


def map_of(settings: Settings) -> ParamMap[Any]:
    """The map of the generation that was typed; without one, that of DF and TP."""
    model = typed_model(settings)
    return MAPS[model] if model is not None else BYTE_MAP


def other_maps(settings: Settings) -> tuple[ParamMap[Any], ...]:
    """Those of the further generations that the hand may turn out to be; none where one was typed."""
    return () if typed_model(settings) is not None else tuple(one for one in MAPS.values() if one is not BYTE_MAP)


def over_tcp(settings: Settings) -> bool:
    """Whether the LINK is Modbus TCP: tcp://, the simulator's --modbus-tcp, or a transcript of it."""
    if settings.port is None:
        return settings.wire == "modbus-tcp"
    return is_modbus_tcp(settings.port) or recorded_modbus(settings.port) == TCP


def simulator_options(settings: Settings) -> str:
    """The simulator of plain --fake is of the generation that was typed."""
    model = typed_model(settings)
    return f"model={model}" if model is not None else ""


def protocol_of(settings: Settings) -> str:
    """What is spoken on a serial line: auto, eb90 or modbus; a transcript shows it."""
    typed: str | None = settings.own.get("protocol")
    found = protocol_of_link(settings.port or "", typed)
    return typed or "auto" if found == "tcp" else found


def protocol_of_link(link: str, typed: str | None) -> str:
    """What a scan speaks on a LINK: eb90, modbus, tcp, or auto; a transcript shows it."""
    if is_modbus_tcp(link) or recorded_modbus(link) == TCP:
        return "tcp"
    return "modbus" if typed in (None, "auto") and recorded_modbus(link) == RTU else typed or "auto"


def recorded_modbus(link: str) -> str:
    """Which envelope of Modbus the first question of a transcript has; "" = none, or the LINK is no transcript."""
    if not link.startswith("replay:"):
        return ""
    from handctl.files import transcript

    try:
        with transcript(link.removeprefix("replay:")) as file:
            lines = (line.decode("ascii", "replace") for line in iter(lambda: file.readline(1 << 16), b""))
            asked = next((line for line in lines if ">" in line and not line.lstrip().startswith("#")), "")
        return mode_of(bytes.fromhex(asked.partition(">")[2]))
    except (OSError, UsageError, ValueError):
        return ""  # opening it will say what is wrong; a line of CAN has words in it


def is_modbus_tcp(link: str) -> bool:
    """Whether a LINK carries Modbus TCP."""
    return link.startswith("tcp://") or (link.startswith("fake://") and "bus=modbus-tcp" in link)


def asks_rtu(link: ByteLink) -> bool:
    """Whether Modbus RTU may be asked there unsaid.

    At a slow speed a BarrettHand takes the 03 of a read for ^C. At 57600 and 921600 one that starts hears the end of a
    question as FF, the trigger of its boot monitor, and nothing may go ahead of a frame of Modbus.
    """
    return link.replayed or not link.can_set_baud or link.baud is None or link.baud == RTU_SPEED
