"""What the calibrations of the EH55BF1 and the RH56 hands share: the wait for their end. The steps are in each hand's `calibration`."""

from __future__ import annotations

from handctl.devices.inspire import eb90
from handctl.devices.inspire.register_bus import POWER_OFF, RegisterBus
from handctl.model.prompts import Prompts


def wait_for_calibration(bus: RegisterBus, prompts: Prompts, seconds: float, more: str = "") -> eb90.Frame | None:
    """Wait for the frame that reports the end, or for the usual time without one. Sends nothing."""
    started = bus.link.now()
    end = started + seconds
    try:
        while bus.link.now() < end and not bus.over:
            elapsed = bus.link.now() - started
            prompts.progress(f"calibrating {elapsed:4.1f} s of at most {seconds:.0f} s{more}", POWER_OFF)
            step = min(0.25, end - bus.link.now())
            if not bus.reports:
                bus.pause(step)
            elif (frame := bus.listen([eb90.read_reply_prefix(bus.id, eb90.CALIBRATION_END, 1)], step)) is not None:
                return frame
    finally:
        prompts.done()
    return None
