"""Texts that mean no good, for variables and configurations."""

from __future__ import annotations

from tests.hostile.devices import CONTROLS, ESCAPES

TEXTS = {
    "escapes": ESCAPES.replace("\0", ""),
    "not UTF-8": "\udcff\udc9b31m",
    "a blank": " ",
    "no number": "nan",
    "past all bounds": "-1e999",
    "no bound": "inf",
    "zero": "0",
    "digits": "9" * 5_000,
    "digits of other scripts": "\uff11\u0663\u00b2",
    "a huge text": "A" * 100_000,
    "lines": "a\nhandctl: error: forged\n",
    "a choice of another": "json",
    "JSON": '{"a": [1, null]}',
    "a link with no end": "fake://exo?state=/dev/zero",
    "a wrong link": "tcp://[::1",
    "a link in escapes": f"replay:{CONTROLS[0]}",
}
LINK = "fake://{}?clock=virtual"
