"""The AIDIN-hand, for the contract."""

from __future__ import annotations

from tests.contract.facts import Facts, Silent
from tests.fuzz.decoders import AIDIN_GOODS, AIDIN_LIKELY

FACTS = Facts(
    silent=(Silent(), Silent("exchange=poll")),
    places=lambda line: [motor.place for motor in line.device.hand.motors],
    near=2000.0,
    forces=frozenset({"currents"}),
    reports_nothing="none of its feedback keys tells an error or a status (aidin, Feedback keys)",
    nothing_waits="it tells neither its target nor its maximum torque: nobody can see what waits (aidin, Feedback keys)",
    writes={
        "home": "",
        "initial": "",
        "stop": "",
        "bias": "",
        "max-torque": "800",
        "terminal": '{{"hand_mode":5,"maxtorque":800}}',
        "encoders": "index.m3=85000",
        "joints": "index.q3=160",
        "fingertips": "index.z=120",
        "currents": "index.m1=100 --duration 0.3",
        "check": "",
    },
    rule=lambda command: lambda entry: b'"hand_mode"' in entry.data,
    goods=AIDIN_GOODS,
    likely=AIDIN_LIKELY,
    reads={
        "listen": "--duration 1",
        "get": "motor_pos",
        "watch": "--count 2",
        "scan": "",
        "report": "{dir}/report.html --watch 0 --force",
        "log": "{dir}/log.csv --count 2 --force",
    },
    state="start=homed",
    states={"check": "start=open&rate=25"},
    unproven=frozenset(["currents", "max-torque", "stop", "terminal"]),
    adapts=frozenset({"encoders", "joints", "fingertips", "currents", "check"}),  # a ramp from where it is
    halts=dict.fromkeys(
        ("home", "initial", "encoders", "joints", "fingertips", "currents", "check"), b'{"hand_mode":3}'
    ),
    plans=frozenset(),
    broken_from=0,
    lines=(
        *(("status",), ("status", "--check"), ("dump",), ("get", "motor_pos"), ("describe",)),
        *(
            ("report", "{dir}/report.html"),
            ("watch", "motor_pos", "--count", "2"),
            ("log", "{dir}/log.csv", "--count", "2", "--force"),
            ("home", "--yes"),
            ("initial", "--yes"),
        ),
        ("check", "--yes"),
        *(
            ("stop",),
            ("bias",),
            ("max-torque", "500", "--yes"),
            ("max-torque", "0", "--yes"),
            ("encoders", "index.m1=200000"),
        ),
        *(("joints", "index.q3=160"), ("fingertips", "index.x=10")),
        ("currents", "index.m1=100", "--duration", "0.3", "--yes"),
    ),
    states_in="tests.aidin.states",
)
