"""Control commands of the simulated EksoNR, its state, and somebody who walks in it. Loaded only when one is used."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from handctl.number_parsing import whole
from handctl.sim.ekso.device import DATA_COUNT, FEEDBACK, SETTING_COUNT, Device, place_of
from handctl.sim.ekso.mechanics import POSTURES, WRAP
from handctl.sim.engine.simulated_device import NOTHING
from handctl.sim.engine.state_file import Fields, checked, columns, kept, real, spread

HELP = " | ".join(
    (
        f"posture | posture NAME ({', '.join(POSTURES)}) | rise | sit | walk on|off | pose PITCH HIP KNEE",
        "set NAME|ID RAW | get NAME|ID | data WORD [RAW] | feedback WORD RAW | state HEX | live | reboot | boot [MS] | clocks",
        "rtc [YYYY-MM-DDTHH:MM:SS] | unsolicited | counts (pose, data and state hold until live or a movement)",
    )
)
BODY: Fields = {
    "place": ("place", float, 0, 2),
    "direction": ("direction", int, -1, 1),
    "walking": ("walking", bool, 0, 1),
    "clock": ("clock", float, 0, 1e12),
}
LOOK = 0.5  # s between two looks at whether the wearer is upright


def command(device: Device, words: list[str]) -> str | None:
    """One control command (see HELP), as the engine wants it."""
    match words:
        case ["posture"]:
            return f"posture {device.body.posture} state {device.data_words(NOTHING)[18]:04X}"
        case ["counts"]:
            return f"set {device.sets} cancel {device.cancels} violations {device.violations}"
        case ["get", name]:
            return f"{device.settings[place_of(name)]}"
        case ["data", word]:
            return f"{device.data_words(NOTHING)[whole(word, 0, DATA_COUNT - 1)]}"
        case ["clocks"]:
            events = " ".join(f"{at:.3f}:{kind}={ms}" for at, kind, ms in device.unrest.events)
            return f"clocks drift={device.unrest.drift} {events}".rstrip()
        case ["boot"]:
            return f"boot {device.boot_ms()}"
        case ["rtc"]:
            return f"rtc {device.calendar.text(device.now)}"
        case ["live"]:
            device.thaw()
        case ["posture", name] if name in POSTURES:
            device.thaw().pose(name)
        case ["rise" | "sit"]:
            device.thaw().move(1 if words == ["rise"] else -1)
        case ["walk", "on" | "off"]:
            if words[1] == "on" and device.body.posture not in ("standing", "walking"):
                raise ValueError(f"walking starts from standing, it is {device.body.posture}")
            device.thaw().walk(words[1] == "on")
        case ["pose", *numbers] if len(numbers) == 3:
            pitch, hip, knee = (real(text, -180.0, 180.0) for text in numbers)
            device.body.frozen = (pitch, 0.0, hip, knee, hip, knee)
        case ["set", name, raw]:
            device.settings[place_of(name)] = _word(raw)
        case ["data", word, raw]:
            device.pinned[whole(word, 0, DATA_COUNT - 1)] = _word(raw)
        case ["feedback", word, raw]:
            device.feedback[whole(word, 0, len(device.feedback) - 1)] = _word(raw)
        case ["state", digits] if len(digits) == 4:
            device.pinned[18] = _hex(digits)
        case ["reboot"]:
            device.reboot()
        case ["boot", number]:
            device.boot_time.restart(whole(number, 0, WRAP - 1), device.now)
        case ["rtc", text]:
            device.calendar.set(text, device.now)
        case ["unsolicited"]:
            device.send_event(NOTHING)
        case _:
            return ""
    return None


def snapshot(device: Device) -> dict[str, Any]:
    """Settings, counters, clocks and posture as they are; what control commands pinned is left out."""
    return {
        "settings": list(device.settings),
        "feedback": list(device.feedback),
        "boot_ms": device.boot_ms(),
        "rtc": device.calendar.text(device.now),
        "body": {name: float(value) for name, (value,) in kept([device.body], BODY).items()},
    }


def restore(device: Device, state: dict[str, Any]) -> None:
    """All or nothing: everything is read and checked before anything is used."""
    settings = _row(state["settings"], SETTING_COUNT)
    feedback = _row(state["feedback"], len(FEEDBACK))
    boot_ms = state["boot_ms"]
    if not isinstance(boot_ms, int) or not 0 <= boot_ms < WRAP:  # a float is looked for in a range one by one
        raise ValueError(f"boot_ms {boot_ms!r} is not a number of two words")
    body = checked(columns([state["body"]], BODY), BODY, 1)
    if body["walking"][0] and body["place"][0] != 2.0:
        raise ValueError("walking, but not upright")
    device.calendar.set(state["rtc"], device.now)
    device.settings, device.feedback = settings, feedback
    device.boot_time.restart(boot_ms, device.now)
    device.body.walk(False)
    spread([device.body], BODY, body)


def _row(words: Any, count: int) -> list[int]:
    if len(words) != count or not all(isinstance(word, int) and 0 <= word <= 65535 for word in words):
        raise ValueError(f"{words!r} are not {count} words")
    return list(words)


def _word(text: str) -> int:
    """A word; negative numbers are taken as two's complement."""
    if text.startswith("-"):
        return 65536 - whole(text[1:], 1, 32768)
    return whole(text, 0, 65535)


def _hex(digits: str) -> int:
    try:
        return int.from_bytes(bytes.fromhex(digits), "big")
    except ValueError:
        raise ValueError(f"{digits!r} is not a word in hex") from None


def use(device: Device) -> Iterator[float]:
    """Who sits stands up first; the gait, its times and the way to stand up are those of mechanics.py."""
    body = device.body
    device.thaw()
    while True:
        if body.posture == "standing":
            body.walk(True)
        elif body.posture in ("sitting", "held"):
            body.move(1)
        yield LOOK
