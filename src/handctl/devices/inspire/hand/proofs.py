"""What the manuals of the RH56 hands leave open, as experiments (rh56 §1.1, §6, §8). See `model.proofs`."""

from __future__ import annotations

from handctl.devices.inspire import proofs
from handctl.devices.inspire.hand import calibration, motion
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.modbus_bus import TEMPERATURES, ModbusBus
from handctl.devices.inspire.modbus_frames import read_request
from handctl.devices.inspire.register_bus import BETWEEN_PROTOCOLS, POWER_OFF
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.model.prompts import Prompts
from handctl.model.proofs import Observation, Proof
from handctl.model.result import Table


def prepare(hand: Hand) -> None:
    """Find the generation: it decides where everything lies."""
    hand.know()


def _generation(hand: Hand) -> Observation:
    found = hand.gate.seen(hand.bus)
    return Observation(
        found.model,
        "reads that are plausible for this generation only" if found.model else "more than one generation fits",
    )


def _protocol(hand: Hand) -> Observation:
    """Which of the two protocols of a serial line the hand answers."""
    if not hand.bus.serial:
        return Observation(None, "not a serial line")
    wires = hand.wires
    if hand.bus.wire == "rtu":  # EB90 was silent to the first question, or was never asked
        line = SerialBus(hand.bus.link, hand.bus.id, hand.journal, family=hand.kind, timeout=hand.bus.timeout)
        line.gate, line.per, line.asked_first = hand.gate, hand.bus.per, hand.bus.asked_first
        wires = [hand.bus, line]
    found = []
    for bus in wires:
        bus.pause(BETWEEN_PROTOCOLS)
        if proofs.reply(bus, bus.presence, hand.bus)[0] == proofs.ANSWERED:
            found.append("modbus" if bus.wire == "rtu" else bus.wire)
    hand.bus.pause(BETWEEN_PROTOCOLS)
    if len(wires) < 2:
        return Observation(None, "the other protocol was not asked at this speed")
    return Observation("both" if len(found) == 2 else found[0] if found else None, f"answers in {' and '.join(found)}")


def _halves(hand: Hand) -> Observation:
    """How Modbus packs what is one byte a finger: against EB90, which sends temperatures in the order of their addresses."""
    rtu = next((bus for bus in hand.wires if isinstance(bus, ModbusBus) and bus.wire == "rtu"), None)
    if rtu is None or hand.bus.wire != "eb90" or hand.bus.per != 1:
        return Observation(None, "needs EB90 and Modbus RTU on one line")
    address, count = TEMPERATURES
    plain = hand.bus.read(address, count, retries=0)
    rtu.pause(BETWEEN_PROTOCOLS)
    words = rtu.exchange(read_request(address, count // 2)).data
    rtu.pause(BETWEEN_PROTOCOLS)
    ways = {
        "low half first": bytes(plain[place ^ 1] for place in range(count)),
        "high half first": plain,
        "one a register": bytes(byte for value in plain[: count // 2] for byte in (0, value)),
    }
    fits = [name for name, shown in ways.items() if shown == words]
    return Observation(
        fits[0] if len(fits) == 1 else None, f"EB90 {plain.hex(' ').upper()}, Modbus {words.hex(' ').upper()}"
    )


def _calibrate(hand: Hand, prompts: Prompts) -> Table:
    motion.fit_to_move(hand)
    return calibration.calibrate(hand, prompts)


PROOFS = (
    Proof("generation", "no register holds it (rh56 §1.1)", ("df", "tp", "f1", "dg2"), "reads that are plausible for one generation only", _generation),
    Proof("protocol", "EB90 on every serial pair; whether TP's answers it is open (rh56 §8)", ("both", "eb90", "modbus"), "the same read in EB90 and in Modbus RTU", _protocol),
    Proof("byte-groups", "two to a register, low half first (rh56 §2.2, Q10)", "low half first", "temperatures in EB90 and in Modbus RTU", _halves),
    proofs.across((1534, 90), "rh56 §5"),
    proofs.in_gap((1010, 2), (1630, 4), source="rh56 §8"),
    proofs.longest(1546, "rh56 §5"),
    proofs.reply_time("rh56 §5"),
    proofs.signed("current", says="printed without a sign, negative in captures (rh56 §6, Q6)"),
    proofs.speed_register(1002, "rh56 §6, Q1"),
    proofs.set_points("angle_set", "rh56 §6"),
    proofs.write_reply("default_speed", "wrist §2.3.2, sibling capture"),
    proofs.supply("system_voltage", "rh56 §3.1"),
    proofs.ID_ACK,
    proofs.SAVE_FRAMES,
    proofs.calibration_frames(
        "calibrate_force", _calibrate, "a frame with address 2 (chapter 3, example 5; rh56 §6 Q9)",
        f"{POWER_OFF} The whole hand opens and closes, and the calibration replaces the present one. It must be open and empty",
    ),
)  # fmt: skip
