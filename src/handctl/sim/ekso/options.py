"""Options and faults of the simulated EksoNR, name -> help; what they do is in device.py."""

from __future__ import annotations

from handctl.sim.ekso.body import POSTURES

OPTIONS: dict[str, str] = {
    "preset": "values at the first start: clinic (default), vectors (the synthetic transcripts), order or sign (ladders)",
    "posture": f"at the first start: {', '.join(POSTURES)} (default standing)",
    "boot": "BootTime at the first start in ms, 0..4294967295, made odd (default 7654321, vectors: 5000001)",
    "rtc": "the device's date and time, YYYY-MM-DDTHH:MM:SS (default 2026-11-20T14:05:37)",
    "time-body": "bytes in the body of time and date: 4 (default, as in the field) or 3 (as printed)",
    "length": "what the length byte counts: body (default), n-4, n-2 or frame",
    "answer-length": "what the length byte of answers counts (default: as for requests)",
    "quantum": "ms of the grid on which answers leave: 0 (default), 10 or 20",
    "baud": "speed of the port: 115200 (default), 57600 or 9600",
    "usb": "1: on USB, where the speed means nothing, and a restart takes the port away",
    "gap": "seconds of silence that end an unfinished or a bad request (default 0.1)",
    "startup": "seconds that a reboot takes (default 1)",
    "persist": "1: accepted settings survive power-off (default), 0: they do not",
    "refuse-status": "status code under the fault refuse, 1..255 (default 1)",
    "bad-crc": "answer to a bad check value: silence (default) or acknowledge",
    "unknown": "answer to an unknown command: acknowledge (default) or silence",
    "disagree": "little, middling or much: BootTime drifts and jumps, the device restarts, as the seed draws it",
    "sway": "0: nothing moves at rest",
}
FAULTS: dict[str, str] = {
    "acknowledge": "every answer is an acknowledge without a body",
    "acknowledge-set": "SetValue is acknowledged without a status",
    "set-unanswered": "SetValue takes effect, its answer is lost",
    "not-taken": "SetValue is accepted without effect",
    "neighbour": "an accepted SetValue changes the next word as well",
    "pendant": "after each GetSettings someone changes Target Sounds at the pendant",
    "stands-up": "the wearer starts to stand up as SetValue arrives, which the device refuses",
    "fidget": "the hips move by more than 5 deg/s at rest",
    "unlisted-codes": "all codes of GetSettings are unlisted",
    "unknown-state": "State is 5040 hex",
    "stuck-sensor": "left toe pressure never changes",
    "hip-offset": "right hip X is 3 in too far forward",
    "frozen-clock": "BootTime stands still",
    "clock-jump": "BootTime jumps 5 s ahead at each request",
    "reboot": "the device restarts instead of answering",
    "unsolicited": "a frame with command 160 before each answer and every 0.35 s",
    "wrong-command": "answers carry the next command",
    "short-body": "the last word of an answer is missing, with a good check value",
    "stray-zero": "a byte 00 after each answer",
}
