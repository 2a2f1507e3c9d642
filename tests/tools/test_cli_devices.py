"""`handctl devices`, `-d NAME`, the configuration file's place in the precedence, and the lock on a device."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from handctl.command import config_edit
from handctl.errors import LinkError
from handctl.link import device_lock
from handctl.model.command_settings import Settings
from tests.support.cli import Result, Simulator, clean_environment, fake, program, run, spying, wait_until
from tests.support.each_row import each_row

EXO = '[devices.left]\nkind = "exo"\nport = "fake://exo?clock=virtual&id=2"\nid = 2\n'


class Place:
    """A user's directories of their own."""

    def __init__(self, root: Path) -> None:
        self.file = root / "config" / "handctl" / "config.toml"
        self.env = {"XDG_CONFIG_HOME": str(root / "config"), "XDG_RUNTIME_DIR": str(root)}

    def write(self, text: str) -> None:
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self.file.write_text(text)

    def __call__(self, *args: str | Path, env: Mapping[str, str] | None = None, stdin: str = "") -> Result:
        return run(*args, env={**self.env, **(env or {})}, stdin=stdin)

    def origins(self, *args: str, env: Mapping[str, str] | None = None) -> dict[str, tuple[Any, str, str]]:
        """Setting -> value, origin, and where without the folder."""
        rows = self("devices", "show", "--json", *args, env=env).rows
        return {
            row["name"]: (row["value"], row["origin"], row["where"].replace(str(self.file), "FILE")) for row in rows
        }


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path)


# -- naming -----------------------------------------------------------------------------------------------------------


def test_add_use_list_remove(place: Place) -> None:
    link = fake(id=2)
    added = place("devices", "add", "left", "-p", link, "exo", "--id", "2", "--json")
    row = {"name": "left", "family": "exo", "link": link, "id": 2, "baud": None, "timeout": None, "deadline": None, "retries": None}  # fmt: skip
    assert added.rows == [{**row, "file": str(place.file), "result": "added"}]
    assert place.file.read_text() == f'[devices.left]\nkind = "exo"\nport = "{link}"\nid = 2\n'
    for args in (("-d", "left", "exo", "get", "id"), ("exo", "get", "id", "--device", "left")):
        result = place(*args, "--json")
        assert result.values == {"id": 2}
        assert result.json["device"] == {"kind": "exo", "link": link, "fake": True, "id": 2, "model": "EH55BF1"}
    assert place("exo", "get", "id", "--json", env={"HANDCTL_DEVICE": "left"}).values == {"id": 2}
    assert place("devices", "list", "--json").rows == [row]
    assert place("devices", "list", "--format", "plain").out == f"left\texo\t{link}\t2\t\t\t\t\n"
    assert place("devices", "remove", "left", "--json").rows == [{**row, "file": str(place.file), "result": "removed"}]
    assert place.file.read_text() == ""
    empty = place("devices", "list", "--json")
    assert (empty.code, empty.rows, empty.codes()) == (0, [], ["no-devices"])
    gone = place("-d", "left", "exo", "get", "id", "--json")
    assert (gone.code, gone.error["code"]) == (2, "unknown-device")


def test_everything_that_a_device_may_say(place: Place) -> None:
    args = ("--baud", "57600", "--timeout", "0.25", "--deadline", "9", "--retries", "0", "--id", "254")
    assert place("devices", "add", "a", "wrist", "-p", "usb:0403:6001:A1", *args).code == 0
    assert place.file.read_text() == (
        '[devices.a]\nkind = "wrist"\nport = "usb:0403:6001:A1"\nid = 254\nbaud = 57600\ntimeout = 0.25\n'
        "deadline = 9.0\nretries = 0\n"
    )


def test_only_what_the_command_line_says_is_copied(place: Place) -> None:
    place.write("baud = 9600\n")
    env = {"HANDCTL_TIMEOUT": "3", "HANDCTL_PORT": "/dev/ttyS7"}
    refused = place("devices", "add", "a", "exo", "--json", env=env)
    assert (refused.code, refused.error["code"]) == (2, "no-link")
    assert place("devices", "add", "a", "exo", "-p", "/dev/ttyS1", env=env).code == 0
    assert place.file.read_text() == 'baud = 9600\n\n[devices.a]\nkind = "exo"\nport = "/dev/ttyS1"\n'


def test_a_name_is_not_taken_twice(place: Place) -> None:
    place.write(f"# mine\n{EXO}# end\n")
    again = place("devices", "add", "left", "wrist", "-p", "tcp://h:1", "--json")
    assert (again.code, again.error["code"]) == (2, "name-taken")
    assert "line 2" in again.error["text"] and "--force" in again.error["hint"]
    assert place.file.read_text() == f"# mine\n{EXO}# end\n"
    forced = place("devices", "add", "left", "wrist", "-p", "tcp://h:1", "--force", "--json")
    assert forced.rows[0]["result"] == "replaced"
    assert place.file.read_text() == '# mine\n[devices.left]\nkind = "wrist"\nport = "tcp://h:1"\n# end\n'


def test_a_link_that_is_no_utf8_is_refused_and_the_file_stays_readable(place: Place) -> None:
    place.write(EXO)
    for more in ((), ("--dry-run",)):
        done = place("devices", "add", "odd", "exo", "-p", "/dev/x\udcff", "--json", *more)
        assert (done.code, done.error["code"], place.file.read_text()) == (2, "config", EXO), done
    assert [row["name"] for row in place("devices", "list", "--json").rows] == ["left"]


def test_a_dry_run_writes_nothing(place: Place) -> None:
    planned = place("devices", "add", "a", "exo", "-p", "/dev/ttyS1", "-n", "--json")
    assert (planned.code, planned.codes()) == (0, ["dry-run"])
    assert not place.file.exists()
    place.write(EXO)
    assert place("devices", "remove", "left", "-n").code == 0
    assert place.file.read_text() == EXO


@each_row(
    ("args", "words"),
    [
        (("a b", "exo", "-p", "/dev/x"), "a b"), (("a", "toaster", "-p", "/dev/x"), "toaster"),
        (("a", "-p", "/dev/x"), "No family given"), (("a", "exo"), "No LINK given"), (("a", "exo", "--fake"), "--fake"),
        (("a", "exo", "-p", ""), "empty"), (("a", "exo", "-p", "ttyUSB0"), "full path"),
        (("a", "exo", "-p", "usb:0403"), "usb:VID:PID"), (("a", "exo", "-p", "usb:04033:1"), "usb:VID:PID"),
        (("a", "exo", "-p", "usb:zz:1"), "usb:VID:PID"), (("a", "exo", "-p", "tcp://host"), "tcp://HOST:PORT"),
        (("a", "ekso", "-p", "/dev/ttyACM0", "--id", "3"), "--id: ekso has no device ids"),
        (("a", "aidin", "-p", "tcp://h", "--baud", "9600"), "--baud: aidin has no serial port"),
        (("a", "aidin", "-p", "/dev/ttyUSB0"), "no serial port"), (("a", "aidin", "-p", "usb:0403:6001"), "no serial port"),
        (("a", "aidin", "-p", "COM3"), "no serial port"), (("a", "aidin", "-p", "spy:///dev/ttyUSB0"), "no serial port"),
        (("a", "exo", "-p", "can:socketcan:can0"), "no CAN interface"), (("a", "wrist", "-p", "can:socketcan"), "can:INTERFACE"),
        (("a", "exo", "-p", "fake://wrist"), "simulated wrist"), (("a", "exo", "-p", "nosuch://x"), "nosuch://"),
        (("a", "exo", "-p", "socket://"), "the address is missing"), (("a", "exo", "-p", "/dev/x", "--id", "255"), "255"),
        (("a", "exo", "-p", "/dev/x", "--timeout", "inf"), "finite"), (("a", "exo", "-p", "/dev/x", "-d", "a"), "-d"),
    ],
)  # fmt: skip
def test_what_cannot_be_named(place: Place, args: tuple[str, ...], words: str) -> None:
    result = place("devices", "add", *args, "--json")
    assert result.code == 2
    assert words in result.error["text"]
    assert not place.file.exists()


@pytest.mark.parametrize(
    ("kind", "link"),
    [("aidin", "tcp://192.168.0.20"), ("wrist", "can:socketcan:can0"), ("wrist", "fake://wrist?bus=can"), ("exo", "COM3"),
     ("ekso", "rfc2217://h:2000"), ("barrett", "replay:t.txt"), ("exo", "/dev/rfcomm0")],
)  # fmt: skip
def test_what_can(place: Place, kind: str, link: str) -> None:
    result = place("devices", "add", "a", kind, "-p", link, "--json")
    assert (result.code, result.codes()) == (0, ["next"]), result
    assert place("devices", "list", "--json").rows[0]["link"] == link


def test_a_name_that_plugging_changes_gets_a_better_one(
    place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    adapter, tty, by_id = tmp_path / "usb1" / "1-2", tmp_path / "tty", tmp_path / "by-id"
    (adapter / "1-2:1.0" / "ttyUSB0").mkdir(parents=True)
    (tty / "ttyUSB0").mkdir(parents=True)
    (tty / "ttyUSB0" / "device").symlink_to(adapter / "1-2:1.0" / "ttyUSB0")
    monkeypatch.setattr(config_edit, "TTY", str(tty))
    monkeypatch.setattr(config_edit, "BY_ID", str(by_id))
    assert config_edit.stable_name("/dev/ttyUSB0") == ""
    for key, text in (("idVendor", "0403"), ("idProduct", "6001"), ("serial", "A1B2")):
        (adapter / key).write_text(f"{text}\n")
    result = place("devices", "add", "a", "exo", "-p", "/dev/ttyUSB0", "--json")
    (warning,) = [message for message in result.json["messages"] if message["level"] == "warning"]
    assert (warning["code"], warning["hint"]) == ("unstable-name", "Use -p usb:0403:6001:A1B2")
    assert result.rows[0]["link"] == "/dev/ttyUSB0"
    by_id.mkdir()
    (by_id / "usb-FTDI_A1B2-if00").symlink_to("/dev/ttyUSB0")
    assert config_edit.stable_name("/dev/ttyUSB0") == f"{by_id}/usb-FTDI_A1B2-if00"
    assert config_edit.stable_name("/dev/ttyS0") == config_edit.stable_name(f"{by_id}/usb-FTDI_A1B2-if00") == ""


SCAN = [
    {"family": "exo", "link": "/dev/ttyS1", "baud": 57600, "id": 4},
    {"family": "aidin", "link": "tcp://h:8000", "id": None},
    {"family": "exo", "link": "/dev/ttyS1", "baud": 57600, "id": 5, "error": "garbage"},
]


def test_from_a_scan(place: Place, tmp_path: Path) -> None:
    text = json.dumps({"schema": "handctl/1", "rows": SCAN}, indent=1)
    lines = "\n".join(json.dumps(row) for row in [*SCAN, {"end": {"schema": "handctl/1"}}])
    (tmp_path / "scan.json").write_text(text)
    for source, stdin in (("-", text), ("-", lines), ("-", json.dumps(SCAN)), (tmp_path / "scan.json", "")):
        result = place("devices", "add", "a", "exo", "--from-scan", source, "--force", "--json", stdin=stdin)
        assert result.code == 0, result
        assert [result.rows[0][key] for key in ("family", "link", "baud", "id")] == ["exo", "/dev/ttyS1", 57600, 4]
    assert place("devices", "add", "b", "--from-scan", "-", "-p", "tcp://h:8000", stdin=text).code == 0
    assert '[devices.b]\nkind = "aidin"\nport = "tcp://h:8000"\n' in place.file.read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [(json.dumps(SCAN), "2 devices"), ("[]", "No device"), ("", "No device"), ("no", "not JSON"), ("3", "No device"),
     ('[{"link": "/dev/x"}]', "family = None"), ('[{"link": "/dev/x", "family": "toaster"}]', "'toaster'"),
     ('[{"link": "/dev/x", "family": "exo", "id": "1"}]', "id = '1'"), ('[{"link": 3, "family": "exo"}]', "link = 3"),
     ('[{"link": "/dev/x", "family": "exo", "id": true}]', "id = True")],
)  # fmt: skip
def test_a_scan_that_does_not_tell(place: Place, text: str, words: str) -> None:
    result = place("devices", "add", "a", "--from-scan", "-", "--json", stdin=text)
    assert result.code == 2
    assert words in result.error["text"]
    assert not place.file.exists()


def test_the_default_device_is_not_taken_away(place: Place) -> None:
    place.write(f'device = "left"\n{EXO}')
    result = place("devices", "remove", "left", "--json")
    assert result.code == 2
    assert "line 1" in result.error["text"]
    place.write('device = "gone"\n')
    assert place("exo", "get", "id").code == 2
    assert place("devices", "add", "gone", "exo", "-p", fake()).code == 0
    assert place("exo", "get", "id", "--format", "plain").out == "1\n"


# -- which device is meant --------------------------------------------------------------------------------------------


def test_a_device_of_another_family_is_refused(place: Place) -> None:
    place.write(EXO)
    for args in (("-d", "left", "wrist", "status"), ("wrist", "status", "-d", "left", "--fake"),
                 ("wrist", "describe", "-d", "left"), ("wrist", "status", "-d", "left", "-p", "fake://wrist")):  # fmt: skip
        with spying() as spy:
            result = place(*args, "--json")
        assert (result.code, result.error["code"]) == (2, "wrong-family")
        assert "'left' is of family exo" in result.error["text"]
        assert spy.lines == []


def test_a_default_device_is_for_its_own_family(place: Place) -> None:
    place.write(f'device = "left"\n{EXO}')
    assert place("exo", "get", "id", "--format", "plain").out == "2\n"
    assert place("wrist", "describe").code == 0
    for args in (("wrist", "status"), ("wrist", "set", "yaw_set=10", "-n")):
        assert (place(*args, "--json").code, place(*args, "--json").error["code"]) == (2, "wrong-family")
    assert place("wrist", "get", "yaw_actual", "-p", "fake://wrist?clock=virtual").code == 0
    elsewhere = place("exo", "get", "id", "-p", fake(), "--json", env={"HANDCTL_DEVICE": "left"})
    assert elsewhere.values == {"id": 1}, "the id of another device must not go with this port"


def test_the_command_line_stands_above_the_named_device(place: Place) -> None:
    place.write(EXO)
    result = place("-d", "left", "exo", "get", "id", "-p", fake(id=5), "--id", "5", "--json")
    assert (result.values, result.codes()) == ({"id": 5}, [])
    assert (
        place("-d", "left", "exo", "get", "id", "--fake", "--id", "1", "--json").json["device"]["link"] == "fake://exo"
    )


def test_a_port_of_the_environment_is_told_and_never_written_to(place: Place) -> None:
    place.write(EXO)
    env = {"HANDCTL_PORT": fake(id=2, seed=9)}
    read = place("-d", "left", "exo", "get", "id", "--json", env=env)
    assert (read.json["device"]["link"], read.codes()) == (env["HANDCTL_PORT"], ["other-port"])
    with spying() as spy:
        refused = place("-d", "left", "exo", "clear-errors", "-y", "--json", env=env)
    assert (refused.code, refused.error["code"], spy.lines) == (2, "two-devices", [])
    assert place("-d", "left", "exo", "clear-errors", "-n", env=env).code == 0


# -- the file in the order of precedence ------------------------------------------------------------------------------


def test_the_origin_of_every_value(place: Place) -> None:
    place.write(
        f'# bench\ntimeout = 4\nretries = 7\ndeadline = 60\nformat = "csv"\nport = "/dev/ttyS9"\ncan = true\n{EXO}timeout = 2.5\n'
    )
    env = {"HANDCTL_BAUD": "19200", "HANDCTL_RETRIES": "1"}
    found = place.origins("left", "--id", "3", env=env)
    own = dict.fromkeys(("exchange", "interrupt", "model", "poll_json", "protocol", "side", "tx_terminator"))
    own["interrupt"] = False
    assert list(found) == [*(name for name in Settings._fields if name != "own"), *own]
    said = {
        "device": ("left", "command line", ""), "kind": ("exo", "named device", "FILE:8"),
        "port": ("fake://exo?clock=virtual&id=2", "named device", "FILE:10"), "id": (3, "command line", ""),
        "baud": (19200, "environment", "HANDCTL_BAUD"), "timeout": (2.5, "named device", "FILE:12"),
        "deadline": (60.0, "configuration file", "FILE:4"), "retries": (1, "environment", "HANDCTL_RETRIES"),
        "format": ("json", "command line", ""),
    }  # fmt: skip
    assert {key: found[key] for key in said} == said
    defaults = Settings._field_defaults | own
    assert {key: found[key] for key in found if key not in said} == {
        key: (defaults[key], "default", "") for key in found if key not in said
    }
    bare = place.origins()
    assert bare["device"] == (None, "default", "")
    assert bare["port"] == ("/dev/ttyS9", "configuration file", "FILE:6")
    assert bare["timeout"] == (4.0, "configuration file", "FILE:2")
    assert place.origins(env={"HANDCTL_DEVICE": "left"})["device"] == ("left", "environment", "HANDCTL_DEVICE")
    assert place.origins("-d", "left") == place.origins("left")
    assert place("devices", "show", "nobody", "--json").error["code"] == "unknown-device"


def test_the_file_stands_behind_the_environment(place: Place) -> None:
    place.write(f'format = "plain"\nport = "{fake(id=3)}"\nid = 3\n')
    assert place("exo", "get", "id").out == "3\n"
    assert place("exo", "get", "id", env={"HANDCTL_ID": "4", "HANDCTL_PORT": fake(id=4)}).out == "4\n"
    assert place("exo", "get", "id", "--fake", "--id", "1", "--json").json["device"]["link"] == "fake://exo"
    assert place("exo", "get", "id", "--json").values == {"id": 3}
    place.write("fake = true\njson = true\n")
    assert place("exo", "get", "id").values == {"id": 1}
    assert place("exo", "get", "id", env={"HANDCTL_FAKE": "0"}).json["exit_code"] == 2
    place.write("can = true\nfake = true\n")
    assert place("wrist", "get", "yaw_actual", "--json").json["device"]["link"] == "fake://wrist?bus=can"
    assert place("exo", "get", "id", "--json").json["device"]["link"] == "fake://exo"


def test_yes_in_the_file_is_told(place: Place) -> None:
    place.write("yes = true\n")
    result = place("exo", "set", "id=2", "-p", fake(), "--json")
    assert (result.code, "yes-from-file" in result.codes()) == (0, True)
    assert "yes-from-file" not in place("exo", "set", "id=2", "-p", fake(), "-y", "--json").codes()


@pytest.mark.parametrize(
    ("text", "words"),
    [("port = 3\n", "line 1: port = 3"), ("\nbaudrate = 9600\n", "line 2: baudrate"), ("port = ", "line 1: not valid TOML"), ("a b", "at column 3"),
     ('port = "x"\nfake = true\n', "port and fake exclude"), ('json = true\nformat = "csv"\n', "exclude each other"),
     ("[devices.left]\nkind = 'exo'\n", "line 1: device left has no port")],
)  # fmt: skip
def test_a_damaged_file_stops_every_command(place: Place, text: str, words: str) -> None:
    place.write(text)
    for args in (("exo", "get", "id", "--fake"), ("-d", "left", "exo", "status"), ("devices", "list"),
                 ("devices", "add", "a", "exo", "-p", "/dev/x")):  # fmt: skip
        with spying() as spy:
            result = place(*args, "--json")
        assert (result.code, spy.lines) == (2, [])
        assert words in result.error["text"] and str(place.file) in result.error["text"]
    assert place.file.read_text() == text
    assert place("-h").code == place("exo", "dump", "-h").code == place("--version").code == 0


def test_the_completion_comes_out_whatever_the_file_says(place: Place) -> None:
    for text in ("damaged", 'format = "json"\n'):
        place.write(text)
        assert place("completion", "bash").out.startswith("# bash completion of handctl")


def test_a_file_that_is_named_must_be_there(place: Place, tmp_path: Path) -> None:
    env = {"HANDCTL_CONFIG": str(tmp_path / "my.toml")}
    missing = place("exo", "get", "id", "--fake", "--json", env=env)
    assert (missing.code, missing.error["code"]) == (2, "config")
    assert place("devices", "list", env=env).code == 0
    assert place("devices", "add", "a", "exo", "-p", fake(), env=env).code == 0
    assert (tmp_path / "my.toml").read_text().startswith("[devices.a]\n")
    assert place("-d", "a", "exo", "get", "id", "--format", "plain", env=env).out == "1\n"
    (tmp_path / "my.toml").unlink()
    (tmp_path / "my.toml").symlink_to(tmp_path / "nowhere")
    assert place("exo", "get", "id", "--fake", env=env).code == 2


PROBE = "import sys; from handctl.cli import main; main(sys.argv[1:]); print(sorted(sys.modules), file=sys.stderr)"


@pytest.mark.real
def test_without_a_file_nothing_is_loaded_for_it(place: Place) -> None:
    place.write("not TOML at all")
    here = {**clean_environment(place.env)}
    nowhere = {**here, "XDG_CONFIG_HOME": "/dev/null/none"}
    for args, env in ((("exo", "dump", "--fake"), nowhere), (("exo", "dump", "-h"), here)):
        done = subprocess.run(
            [*program()[:1], "-c", PROBE, *args], env=env, capture_output=True, text=True, timeout=30, check=False
        )
        modules = set(done.stderr.rpartition("[")[2].replace("'", "").strip("]\n").split(", "))
        assert "handctl.command.options" in modules, done
        assert not {"tomllib", "handctl.command.config_file", "handctl.link.device_lock", "fcntl", "hashlib"} & modules


# -- one process at a time --------------------------------------------------------------------------------------------


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


@pytest.fixture
def terminal() -> Iterator[str]:
    ends = os.openpty()
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


def test_the_second_is_told_who_holds_it(runtime: Path) -> None:
    first = device_lock.hold("tcp://127.0.0.1:8000", "handctl aidin watch")
    assert first is not None
    with pytest.raises(LinkError) as caught:
        device_lock.hold("socket://LOCALHOST:8000", "handctl aidin stop")
    assert (caught.value.exit_code, caught.value.code) == (3, "busy")
    assert f"`handctl aidin watch` (pid {os.getpid()})" in caught.value.text
    other = device_lock.hold("tcp://127.0.0.1:8001", "handctl aidin watch")
    first.release()
    first.release()
    second = device_lock.hold("tcp://127.0.0.1:8000", "handctl aidin stop")
    for held in (other, second):
        assert held is not None
        held.release()
    assert {path.parent.name for path in runtime.glob("*/lock-*")} == {"handctl"}


@pytest.mark.real
def test_a_holder_that_is_gone_is_not_named(runtime: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_lock, "LAST_STOP_SECONDS", 0.02)
    first = device_lock.hold("tcp://h:1", "x")
    assert first is not None
    (path,) = runtime.glob("handctl/lock-*")
    for text in ("", f"{2**22 + 1} handctl exo watch\n", "no\n", "9" * 30):
        path.write_text(text)
        with pytest.raises(LinkError, match=r"in use by another handctl$") as caught:
            device_lock.hold("tcp://h:1", "x")
        assert "kill" not in caught.value.hint
    first.release()


@pytest.mark.real
def test_all_names_of_a_place_are_one(terminal: str, tmp_path: Path) -> None:
    by_id = tmp_path / "usb-Some_Adapter"
    by_id.symlink_to(terminal)
    (tmp_path / "file").write_text("")
    place = device_lock.canonical(terminal)
    assert place.startswith("tty ")
    for name in (by_id, f"spy://{terminal}?file=x", f"can:slcan:{terminal}", f"can:slcan:{by_id}?bitrate=500000"):
        assert device_lock.canonical(str(name)) == place
    assert (
        device_lock.canonical("tcp://Hand.local", 8000)
        == device_lock.canonical("tcp://hand.local:8000/")
        == "tcp hand.local:8000"
    )
    assert (
        device_lock.canonical("tcp://[fe80::1]", 8000)
        == device_lock.canonical("tcp://[FE80::1]:8000")
        == "tcp fe80::1:8000"
    )
    assert device_lock.canonical("can:slcan:socket://localhost:5") == device_lock.canonical(
        "rfc2217://127.0.0.1:5?logging=debug"
    )
    assert device_lock.canonical("can:socketcan:can0?bitrate=1") == "can socketcan:can0"
    assert device_lock.canonical("usb:0403:6001:AB") == device_lock.canonical("USB:0403:6001:ab".replace("USB", "usb"))
    assert device_lock.canonical(str(tmp_path / "file")) == str(tmp_path / "file")
    distinct = [
        "tcp://a:1",
        "tcp://a:2",
        "can:socketcan:can0",
        "can:socketcan:can1",
        "/dev/none",
        "a/b",
        "a_b",
        "x" * 400,
    ]
    assert len({device_lock._file_name(device_lock.canonical(link)) for link in distinct}) == len(distinct)
    assert all(len(device_lock._file_name(device_lock.canonical(link))) < 250 for link in distinct)


def test_a_simulation_in_the_process_is_not_locked(runtime: Path) -> None:
    for link in ("fake://exo", "replay:x", "loop://"):
        assert device_lock.hold(link, "x") is None
    assert list(runtime.iterdir()) == []


def test_where_the_lock_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next place is taken when one cannot be used; without any, nothing is opened."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "gone"))
    held = device_lock.hold("tcp://h:1", "x")
    assert held is not None
    held.release()
    (folder,) = (tmp_path / "tmp").iterdir()
    assert (folder.name, folder.stat().st_mode & 0o777) == (f"handctl-{os.getuid()}", 0o700)
    assert len(list(folder.glob("lock-*"))) == 1
    monkeypatch.setenv("TMPDIR", str(tmp_path / "gone"))
    with pytest.raises(LinkError) as caught:
        device_lock.hold("tcp://h:1", "x")
    assert caught.value.code == "no-lock"


@pytest.mark.real
def test_two_processes_do_not_mix(place: Place, tmp_path: Path) -> None:
    """A stream holds the hand; a second process is turned away until the first is gone, even when it is killed."""
    out = tmp_path / "rows"
    with Simulator("--pty") as server:
        assert place("devices", "add", "left", "-p", server.link, "exo").code == 0
        with out.open("wb") as file:
            first = subprocess.Popen(
                program("-d", "left", "exo", "watch", "id", "--rate", "20", "--duration", "20", "--json"),
                env=clean_environment(place.env), stdout=file, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        try:
            wait_until(lambda: out.stat().st_size > 0)
            refused = place("exo", "get", "id", "-p", server.link, "--json")
            assert (refused.code, refused.error["code"]) == (3, "busy")
            assert f"`handctl exo watch` (pid {first.pid})" in refused.error["text"]
            assert refused.json["counters"]["sent"] == 0
        finally:
            first.kill()
            first.wait(10)
        assert place("-d", "left", "exo", "get", "id", "--format", "plain").out == "1\n"
