"""What the calibrations of the EH55BF1 and the RH56 hands share: their start, the wait for their end, and what shows that they succeeded. The steps are in each hand's `calibration`."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import eb90
from handctl.devices.inspire.id_baud_save_reset import outcome
from handctl.devices.inspire.register_bus import POWER_OFF, RegisterBus
from handctl.devices.inspire.register_device import RegisterDevice
from handctl.devices.inspire.register_map import Register
from handctl.errors import Aftermath, CheckFailed, HandctlError, Hint, joined
from handctl.model.param import Reading
from handctl.model.prompts import Prompts
from handctl.model.result import Finding, Table, hex_bytes
from handctl.model.stop_on_interrupt import no_stop_ends_it


def run_calibration(
    hand: RegisterDevice, register: Register, prompts: Prompts, said: str, seconds: float, least: float = 0.0
) -> tuple[HandctlError | None, eb90.Frame | None, float]:
    """Start a calibration and wait for its end: why the start was not acknowledged, the frame that reported the end, seconds.

    `said` is told once it runs; `seconds` and `least` are those of `wait_for_calibration`. Raises DeviceRefused on Ctrl-C:
    no command stops it (exo §2.3.6, rh56 §9).
    """
    bus, begun = hand.bus, hand.journal.ledger.mark
    left = Aftermath("the hand is still calibrating", f"{POWER_OFF} No documented command stops a calibration")
    with no_stop_ends_it(left, prompts, hand.journal.counters):
        lost = bus.try_write(register.address, register.encode(1), "the start", "handctl still waits for the end")
        started = bus.link.now()
        prompts.say(f"{POWER_OFF} The calibration is running. {said}")
        frame = wait_for_calibration(bus, prompts, seconds, least)
    if frame is not None and frame.data == b"\0":
        hand.journal.ledger.confirm("its end was reported", since=begun)
    return lost, frame, bus.link.now() - started


def wait_for_calibration(bus: RegisterBus, prompts: Prompts, seconds: float, least: float) -> eb90.Frame | None:
    """Wait for the frame that reports the end, or for the usual time without one. Sends nothing.

    `least`: seconds that the manual's own steps take. An end that is reported sooner is not believed: the hand may still be moving.
    Reported with 00, it counts as not reported; otherwise it is returned where no other report comes.
    """
    started, early = bus.link.now(), None
    end, more = started + seconds, f" (waits {least:g} s, the rest is movement)" if least else ""
    try:
        while bus.link.now() < end and not bus.over:
            elapsed = bus.link.now() - started
            prompts.progress(f"calibrating {elapsed:4.1f} s of at most {seconds:.0f} s{more}", POWER_OFF)
            step = min(0.25, end - bus.link.now())
            if not bus.reports:
                bus.pause(step)
            elif (frame := bus.listen([eb90.read_reply_prefix(bus.id, eb90.CALIBRATION_END, 1)], step)) is not None:
                if (elapsed := bus.link.now() - started) < least:
                    early = frame if frame.data != b"\0" else early
                    bus.journal.warn(
                        "early-end",
                        f"the hand reported the end of the calibration after {elapsed:.1f} s, but its documented steps take at least {least:g} s. handctl keeps waiting",
                        hint="treat the hand as still calibrating",
                    )
                    continue
                bus.journal.ledger.unstoppable(None, 0.0)
                return frame
    finally:
        prompts.done()
    if bus.link.now() >= end:
        bus.journal.ledger.unstoppable(None, 0.0)
    return early


def calibration_result(
    hand: RegisterDevice, register: Register, frame: eb90.Frame | None, after: Sequence[Reading]
) -> Table:
    """The result of a calibration, from the frame that reported its end and from what was read `after` it.

    ``completed`` only where the end was reported with 00 and no actuator reports an error. The meaning of another byte is open:
    FF is a save that failed (RH56 ch. 3 ex. 4, 5).
    """
    after = hand.present(after)  # a firmware without error bits has none that could speak against it
    said = frame.data if frame is not None else None
    faults = [
        Finding(f"{one.element.part}: {label}", tuple(label.split(", ")))
        for one in after
        if one.element.param.name == "error" and one.value and (label := one.element.param.label(one.value))
    ]
    against = [] if said in (None, b"\0") else [f"its end was reported with {hex_bytes(said or b'')} instead of 00"]
    if any(one.error is not None for one in after if one.element.param.name == "error"):
        against.append("the error bits could not be read after it")
    against += [f"errors are reported after it: {'; '.join(one.text for one in faults)}"] if faults else []
    table = outcome(hand, register, "not reported" if said is None else "ended" if against else "completed", said)
    table.rows += [hand.row(one) for one in after if one.element.param.name != "error" or one.value != 0]
    table.columns = hand.columns
    if against:
        from handctl.model.device_picture import hint_of

        table.failure = CheckFailed(
            f"{hand.bus.where}: nothing shows that the calibration succeeded: {', and '.join(against)}",
            hint=joined(
                Hint("check with {}", f"{hand.kind} status"), hint_of(hand.kind, faults), "then calibrate again"
            ),
            code="not-calibrated",
        )
    return table
