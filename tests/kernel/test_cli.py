"""Options at every level, environment, precedence, and usage errors of the command line."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

import handctl
from tests.support.cli import Result, check_schema, fake, run, sent, spying
from tests.support.each_row import each_row

BUS_2 = "EB 90 02 04 11 E8 03 01 03"
"""Read the id of the hand with id 2."""


def link_of(result: Result) -> str:
    return str(result.json["device"]["link"])


# -- where options may stand ------------------------------------------------------------------------------------------


@each_row(
    "args",
    [
        ("--fake", "--json", "exo", "dump"),
        ("exo", "--fake", "--json", "dump"),
        ("exo", "dump", "--fake", "--json"),
        ("--json", "exo", "--fake", "dump"),
        ("--fake", "exo", "--format", "json", "dump"),
    ],
)
def test_options_mean_the_same_at_every_level(args: Sequence[str]) -> None:
    result = run(*args)
    assert result.code == 0
    assert len(result.rows) == 42
    assert result.json["device"] == {"kind": "exo", "link": "fake://exo", "fake": True, "id": 1, "model": "EH55BF1"}


def test_the_option_nearest_the_verb_wins() -> None:
    root, group, leaf = fake(seed=1), fake(seed=2), fake(seed=3)
    assert link_of(run("-p", root, "exo", "-p", group, "get", "id", "-p", leaf, "--json")) == leaf
    assert link_of(run("-p", root, "exo", "-p", group, "get", "id", "--json")) == group
    assert link_of(run("-p", root, "exo", "get", "id", "--json")) == root
    assert run("--json", "exo", "--csv", "get", "id", "--format", "plain", "--fake").out == "1\n"
    assert run("--format", "plain", "exo", "get", "id", "--json", "--fake").values == {"id": 1}
    nearest = run("--id", "9", "exo", "--id", "8", "get", "id", "--id", "2", "--json", "-p", fake(id=2))
    assert nearest.values == {"id": 2}


def test_the_last_of_two_equal_options_wins() -> None:
    assert run("exo", "get", "id", "--fake", "--json", "--format", "plain").out == "1\n"
    assert run("exo", "get", "id", "--fake", "--format", "plain", "--json").values == {"id": 1}
    assert link_of(run("-p", fake(seed=1), "exo", "get", "id", "-p", fake(seed=2), "--json")) == fake(seed=2)


def test_port_and_fake_override_each_other_by_level() -> None:
    link = fake(seed=4)
    assert link_of(run("-p", link, "exo", "get", "id", "--fake", "--json")) == "fake://exo"
    assert link_of(run("--fake", "exo", "get", "id", "-p", link, "--json")) == link
    assert link_of(run("--fake", "exo", "-p", link, "get", "id", "--json")) == link
    for args in (("--fake", "-p", link), ("-p", link, "--fake")):
        result = run("exo", "get", "id", "--json", *args)
        assert result.code == 2
        assert "--port" in result.error["text"] and "--fake" in result.error["text"]


# -- environment ------------------------------------------------------------------------------------------------------


def test_environment_stands_behind_the_command_line() -> None:
    link = fake(id=2)
    env = {"HANDCTL_PORT": link, "HANDCTL_ID": "2", "HANDCTL_FORMAT": "json"}
    assert run("exo", "get", "id", env=env).values == {"id": 2}
    assert link_of(run("exo", "get", "id", env=env)) == link
    assert run("exo", "get", "id", "--format", "plain", env=env).out == "2\n"
    assert run("--format", "plain", "exo", "get", "id", env=env).out == "2\n"
    assert run("exo", "get", "id", "--fake", "--id", "1", env=env).json["device"]["link"] == "fake://exo"
    assert link_of(run("exo", "get", "id", "-p", fake(), env={"HANDCTL_FAKE": "1", "HANDCTL_FORMAT": "json"})) == fake()
    assert run("exo", "get", "id", env={"HANDCTL_FAKE": "1"}).code == 0
    assert run("exo", "get", "id", env={"HANDCTL_FAKE": "0"}).code == 2
    assert run("exo", "get", "id", env={"HANDCTL_FAKE": ""}).code == 2


@each_row(
    ("name", "value"),
    [("JSON", "1"), ("FORMAT", "json")],
)
def test_every_output_option_has_a_variable(name: str, value: str) -> None:
    assert run("exo", "get", "id", "--fake", env={f"HANDCTL_{name}": value}).values == {"id": 1}


def test_csv_has_a_variable() -> None:
    assert run("exo", "get", "id", "--fake", env={"HANDCTL_CSV": "1"}).out.startswith("name,finger,address,value")


def test_further_variables(tmp_path: Path) -> None:
    trace, output = tmp_path / "t.txt", tmp_path / "out.json"
    env = {"HANDCTL_TRACE": str(trace), "HANDCTL_OUTPUT": str(output), "HANDCTL_VERBOSE": "1"}
    result = run("exo", "get", "id", "--json", "-p", fake(), env=env)
    assert (result.code, result.out) == (0, "")
    assert json.loads(output.read_text())["rows"][0]["value"] == 1
    assert sent(trace)[0] == bytes.fromhex("EB 90 01 04 11 E8 03 01 02")
    assert "> EB 90 01 04 11 E8 03 01 02" in result.err

    assert run("exo", "set", "id=2", "-p", fake(), env={"HANDCTL_YES": "1"}).code == 0
    with spying() as spy:
        assert run("exo", "set", "id=2", "-p", fake(), env={"HANDCTL_DRY_RUN": "1"}).code == 0
    assert spy.lines == []

    with spying() as spy:
        silent = run("exo", "get", "id", "--json", "-p", fake(fault="deaf"), env={"HANDCTL_RETRIES": "5"})
    assert silent.json["counters"]["retries"] >= 5
    for variable, least, most in (("TIMEOUT", 3.0, 20.0), ("DEADLINE", 0.0, 0.11)):
        env = {f"HANDCTL_{variable}": {"TIMEOUT": "1.0", "DEADLINE": "0.1"}[variable]}
        with spying() as spy:
            assert run("exo", "get", "id", "-p", fake(fault="deaf"), env=env).code == 4
        assert least <= spy.now <= most, (variable, spy.now)
    with spying() as spy:
        assert run("exo", "get", "id", "-p", fake(baud=57600), env={"HANDCTL_BAUD": "57600"}).code == 0
    assert spy.lines[-1].client_baud == 57600
    quiet = run("exo", "clear-errors", "-p", fake(fault="over-temperature"), env={"HANDCTL_QUIET": "1"})
    assert (quiet.code, quiet.err) == (0, "")
    coloured = run("exo", "status", "--fake", env={"HANDCTL_COLOR": "always"})
    assert "\x1b[" in coloured.out


@each_row(
    ("name", "value"),
    [("ID", "two"), ("TIMEOUT", "0"), ("TIMEOUT", "-1"), ("FORMAT", "xml"), ("BAUD", "0"), ("FAKE", "perhaps"),
     ("COLOR", "pink"), ("RETRIES", "-1")],
)  # fmt: skip
def test_a_bad_variable_is_named(name: str, value: str) -> None:
    with spying() as spy:
        result = run("exo", "get", "id", "--fake", env={f"HANDCTL_{name}": value})
    assert result.code == 2 if name != "FAKE" else result.code in (0, 2)
    if result.code == 2:
        assert f"HANDCTL_{name}={value}" in result.err
        assert spy.lines == []


# -- nothing, help, version -------------------------------------------------------------------------------------------


def test_version_and_help() -> None:
    for args in (("--version",), ("-V",), ("exo", "-h"), ("-h",), ("exo", "dump", "--help")):
        result = run(*args)
        assert (result.code, result.err) == (0, ""), args
    assert run("--version").out == f"handctl {handctl.__version__}\n"
    assert "Inspire EH55BF1" in run("-h").out
    text = run("exo", "set", "-h").out
    for option in ("--port", "--fake", "--id", "--baud", "--timeout", "--deadline", "--retries", "--trace", "--format",
                   "--json", "--csv", "--output", "--color", "--quiet", "--verbose", "--debug", "--dry-run", "--yes"):  # fmt: skip
        assert option in text


def test_a_command_that_writes_says_so_in_its_help() -> None:
    words = ("write", "clear", "save", "keep", "command", "give", "restore", "calibrate", "send", "reset")
    for verb in ("set", "write", "raw", "id", "baud", "clear-errors", "save", "factory-reset", "calibrate", "force",
                 "position", "restore"):  # fmt: skip
        text = run("exo", verb, "-h").out.casefold()
        assert any(word in text.split("options:")[0] for word in words), verb


@each_row("args", [(), ("exo",)])
def test_without_a_command_the_help_is_shown(args: Sequence[str]) -> None:
    result = run(*args)
    text = result.out + result.err
    assert "Usage: handctl" in text and ("Inspect:" if args else "Devices:") in text
    assert "handctl: error" not in text
    assert result.code in (0, 2)


# -- usage errors -----------------------------------------------------------------------------------------------------

USAGE_ERRORS = [
    ("exo", "dmup"),
    ("oxe", "dump"),
    ("exo", "dump", "--fak"),
    ("exo", "get"),
    ("exo", "dump", "extra"),
    ("exo", "get", "id", "--timeout", "soon"),
    ("exo", "force", "1", "2", "3"),
    ("exo", "read", "1000"),
    ("exo", "get", "positon_actual"),
    ("exo", "get", "error.pinky"),
    ("exo", "get", "id.little"),
    ("exo", "get", "factory_reset"),
    ("exo", "describe", "nosuch"),
    ("exo", "dump", "-n"),
    ("exo", "id", "-n"),
    ("exo", "baud", "-n"),
    ("exo", "get", "id", "--id", "0"),
    ("exo", "get", "id", "--id", "255"),
    ("exo", "get", "id", "-p", ""),
    ("exo", "get", "id", "-p", "fake://toaster"),
    ("exo", "get", "id", "-p", "fake://exo?fault=nosuch"),
    ("exo", "get", "id", "-p", "fake://exo?nosuch=1"),
    ("exo", "get", "id", "-p", "fake://exo?seed"),
    ("exo", "get", "id", "-p", "fake://exo?clock=wall"),
    ("exo", "get", "id", "-p", "tcp://localhost"),
    ("exo", "get", "id", "-p", "can:socketcan:can0"),
    ("exo", "get", "id", "-p", "usb:0403"),
    ("exo", "get", "id", "-p", "usb:zz:yy"),
    ("exo", "get", "id", "-p", "replay:no-such-file"),
    ("exo", "get", "id", "-p", "nosuch://x"),
]


@each_row("args", USAGE_ERRORS, ids=" ".join)
def test_usage_error(args: Sequence[str]) -> None:
    """Exit 2, one message with the next step on stderr, nothing on stdout; with --json the envelope."""
    given = () if "-p" in args else ("--fake",)
    plain = run(*args, *given)
    assert plain.code == 2, plain
    assert plain.out == ""
    assert plain.err.startswith("handctl: error: ")
    assert "Traceback" not in plain.err
    for result in (run("--json", *args, *given), run(*args, *given, "--format=json"),
                   run(*args, *given, env={"HANDCTL_FORMAT": "json"})):  # fmt: skip
        envelope = result.json
        assert (result.code, envelope["ok"], envelope["rows"]) == (2, False, [])
        assert result.error["text"] in plain.err
    ndjson = run("--format", "ndjson", *args, *given)
    rows, _end = ndjson.stream
    assert rows == []


def test_impossible_format() -> None:
    result = run("--json", "exo", "get", "id", "--fake", "--format", "xml")
    assert (result.code, result.out) == (2, "")
    assert "xml" in result.err and "ndjson" in result.err


def test_no_device_is_exit_2() -> None:
    for args in (("dump",), ("status",), ("watch",), ("id", "2", "-y"), ("calibrate", "-y")):
        result = run("exo", *args)
        assert (result.code, result.out) == (2, "")
        assert "error: No device" in result.err and "--fake" in result.err
    assert run("exo", "dump", "--json").error["code"] == "no-link"
    assert run("exo", "dump", "--json").json["device"] == {"kind": "exo", "link": None, "fake": False, "id": None}


def test_commands_without_a_device_need_none() -> None:
    assert run("exo", "describe").code == 0
    assert run("exo", "set", "position_set.index=300", "-n").code == 0


@pytest.mark.parametrize(
    ("name", "near"),
    [("positon_actual", "position_actual"), ("temprature", "temperature"),
     ("baud", "baud_code"), ("force_sett", "force_set")],
)  # fmt: skip
def test_unknown_names_get_near_matches(name: str, near: str) -> None:
    for args in (("get", name), ("set", f"{name}=1", "-y"), ("watch", name), ("describe", name)):
        with spying() as spy:
            result = run("exo", *args, "--fake", "--format", "plain")
        assert result.code == 2
        assert near in result.err, result
        assert spy.lines == []


def test_unknown_command_gets_a_near_match() -> None:
    for args, near in ((("exo", "dmup"), "dump"), (("oxe", "dump"), "exo"), (("exo", "calibarte"), "calibrate")):
        result = run(*args, "--fake")
        assert result.code == 2
        assert near in result.err, result


def test_unknown_element_lists_the_elements() -> None:
    result = run("exo", "get", "position_actual.pinky", "--fake", "--json")
    for part in ("little", "ring", "middle", "index", "thumb", "thumb_rotation"):
        assert part in result.error["hint"]


@each_row("args", [("watch", "nosuch", "--fake"), ("watch",), ("watch", "-p", "/dev/no-such-port"),
                                  ("watch", "--fake", "--id", "0"), ("watch", "--fake", "--count", "0")])  # fmt: skip
def test_a_stream_that_cannot_start_ends_as_a_stream(args: Sequence[str]) -> None:
    """`--json` of a stream is NDJSON; its last line is {"end": …} also after an error."""
    result = run("exo", *args, "--json")
    assert result.code == (3 if "/dev/no-such-port" in args else 2)
    (line,) = result.lines if result.out.startswith('{"end"') else [result.out]
    assert set(json.loads(line)) == {"end"}, result
    check_schema(json.loads(line)["end"])


@pytest.mark.real
@each_row(
    ("link", "code"),
    [("/dev/no-such-port", "not-found"), ("/dev/null", "not-a-port"), ("tcp://127.0.0.1:1", "refused")],
)
def test_a_link_that_cannot_be_opened_is_exit_3(link: str, code: str) -> None:
    result = run("exo", "dump", "-p", link, "--json")
    assert result.code == 3
    assert result.error["code"] == code
    assert link in result.error["text"]
    assert result.error["hint"]


def test_debug_shows_a_traceback_and_nothing_else_does() -> None:
    args = ("exo", "get", "id", "-p", fake(fault="silent"))
    assert "Traceback" in run(*args, "--debug").err
    assert "Traceback" in run("--debug", *args).err
    assert "Traceback" not in run(*args).err


def test_an_internal_error_is_exit_1_and_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_self: object) -> None:
        raise RuntimeError("broken on purpose")

    monkeypatch.setattr("handctl.devices.inspire.exo.device.ExoHand.dump", broken)
    result = run("exo", "dump", "--fake", "--json")
    assert result.code == 1
    assert result.error["code"] == "internal"
    assert "Traceback" not in result.err
    assert "Traceback" in run("exo", "dump", "--fake", "--debug").err


def test_can_is_refused_by_a_device_without_that_wire() -> None:
    result = run("exo", "dump", "-p", "can:socketcan:can0", "--json")
    assert (result.code, result.error["code"]) == (2, "usage")
    assert "no CAN interface" in result.error["text"]


def test_dry_run_for_good_does_not_keep_from_reading() -> None:
    env = {"HANDCTL_DRY_RUN": "1"}
    assert run("exo", "get", "id", "-p", fake(), "--format", "plain", env=env).out == "1\n"
    assert run("exo", "set", "force_set.index=-9", "-p", fake(), env=env).lines[1].split()[1:3] == ["EB", "90"]
    refused = run("exo", "get", "id", "-n", "-p", fake(), env=env)
    assert refused.code == 2 and "only reads" in refused.err


@each_row(
    ("env", "words"),
    [
        ({"HANDCTL_PORT": "fake://exo?clock=virtual", "HANDCTL_FAKE": "1"}, "HANDCTL_PORT and HANDCTL_FAKE"),
        ({"HANDCTL_JSON": "1", "HANDCTL_CSV": "1"}, "HANDCTL_JSON and HANDCTL_CSV"),
        ({"HANDCTL_FORMAT": "plain", "HANDCTL_JSON": "1"}, "HANDCTL_FORMAT and HANDCTL_JSON"),
        ({"HANDCTL_SERIAL": "1", "HANDCTL_CAN": "1"}, "HANDCTL_SERIAL and HANDCTL_CAN"),
    ],
)
def test_variables_that_speak_of_one_setting_exclude_each_other(env: dict[str, str], words: str) -> None:
    where = [] if "HANDCTL_PORT" in env else ["--fake"]
    result = run("wrist" if "HANDCTL_CAN" in env else "exo", "describe", *where, env=env)
    assert result.code == 2 and f"{words} exclude each other" in result.err
    if "HANDCTL_SERIAL" not in env:  # what the command line says decides it; nobody asks the variables
        assert run("exo", "describe", "-p", "fake://exo", "--csv", env=env).code == 0


def test_a_variable_that_says_no_is_heard(tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    file.write_text("yes = true\n")
    env = {"HANDCTL_CONFIG": str(file)}
    assert run("exo", "save", "-p", fake(), env=env).code == 0
    assert run("exo", "save", "-p", fake(), env={**env, "HANDCTL_YES": "0"}).code == 8
    assert run("exo", "get", "id", "-p", fake(), env={"HANDCTL_FAKE": "0", "HANDCTL_PORT": "/dev/ttyNONE"}).code == 0


@each_row("words", [
    ("ekso", "time", "--fake", "--id", "3"), ("barrett", "get", "LFT", "--fake", "--id", "1"),
    ("aidin", "status", "--fake", "--id", "1"), ("aidin", "status", "--fake", "--baud", "9600"),
    ("wrist", "get", "move_time", "--fake", "--can", "--serial"),
])  # fmt: skip
def test_what_a_protocol_does_not_have_is_refused(words: tuple[str, ...]) -> None:
    result = run(*words, "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0), result


def test_an_id_for_another_family_in_the_environment_is_none_here() -> None:
    result = run("ekso", "time", "-p", "fake://ekso?clock=virtual", "--json", env={"HANDCTL_ID": "3"})
    assert (result.code, result.json["device"]["id"]) == (0, None)


@each_row(
    "words",
    [
        ("exo", "watch", "--rate", "nan", "--fake"),
        ("exo", "watch", "--rate", "1e-300", "--fake"),
        ("exo", "watch", "--duration", "1e300", "--fake"),
        ("exo", "get", "id", "--timeout", "1e300", "--fake"),
        ("exo", "get", "id", "--deadline", "1e10", "--fake"),
        ("exo", "position", "1", "2", "3", "4", "5", "--wait", "1e300", "--fake", "-y"),
        ("exo", "watch", "--duration", "inf", "--fake"),
        ("exo", "report", "r.html", "--watch", "nan", "--fake"),
        ("wrist", "move", "--pitch", "1", "--time", "1000", "--wait", "nan", "--fake"),
        ("wrist", "move", "--pitch", "1", "--time", "1000", "--wait", "1e300", "--fake"),
        ("wrist", "center", "--wait", "1e300", "--fake"),
        ("ekso", "log", "log.csv", "--duration", "nan", "--fake"),
        ("ekso", "log", "log.csv", "--duration", "1e300", "--fake"),
        ("aidin", "currents", "index.m1=1", "--duration", "nan", "--fake", "--yes"),
        ("sim", "exo", "--pty", "--duration", "nan"),
    ],
)
def test_what_no_clock_can_wait_for_is_refused(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(*words).code == 2
    assert list(tmp_path.iterdir()) == []


@each_row(("words", "command"), [
    (("aidin", "-p", "tcp://127.0.0.1:9", "get"), "aidin get"), (("-p", "exo", "exo", "read", "5"), "exo read"),
    (("exo", "--fake", "force", "1", "2"), "exo force"), (("exo", "--id", "3", "nothing"), "exo"),
])  # fmt: skip
def test_the_envelope_of_a_usage_error_names_the_command(words: tuple[str, ...], command: str) -> None:
    result = run(*words, "--json")
    assert (result.code, result.json["command"]) == (2, command)
