"""The EksoNR, for the contract."""

from __future__ import annotations

import random

from tests.contract.facts import Facts, Silent
from tests.ekso.support import frame
from tests.fuzz.decoders import EKSO_LIKELY, ekso_goods
from tests.support.scripted import unhex

FACTS = Facts(
    silent=(Silent(seconds=2.2, why="0.5 s for each reply, and GetTime behind GetData, which a firmware may lack"),),
    reports_nothing="no command moves it, so none waits for a movement (ekso §4)",
    nothing_waits="whatever it takes is asked for already, and acts with the next step (ekso §4)",
    writes={
        "set": "step_length=15.5 --operator me",
        "restore": "{ekso} --operator me",
        "cancel": "",
        "stop": "",
    },
    rule=lambda command: lambda entry: entry.data[0] not in range(150, 155),
    goods=(*ekso_goods(random.Random(3)), frame(155, 7, unhex("00 CA 06 0E"))),
    likely=EKSO_LIKELY,
    reads={
        "listen": "--duration 1",
        "get": "step_length",
        "snapshot": "{dir}/new.json",
        "diff": "{ekso}",
        "watch": "--count 2",
        "scan": "",
        "report": "{dir}/report.html --watch 0 --force",
        "log": "{dir}/log.csv --count 2 --force",
    },
    snapshot={"step_length": 15.5},
    plans=frozenset(["restore"]),
    screens=("status", "dump", "settings", "data", "feedback"),
    broken_from=2,
    computed=frozenset({"boot_ms", "clock_offset"}),
    lines=(
        ("report", "{dir}/report.html"),
        ("policy",),
        ("terminal", "96 00 00 01 75 E7"),
        ("stop",),
        ("export", "{dir}/log.csv", "--format", "mot"),
        ("gait", "{dir}/log.csv"),
    ),
    looking=frozenset({("terminal", "96 00 00 01 75 E7")}),
    rows_in="tests.ekso.commands",
    states_in="tests.ekso.states",
)
