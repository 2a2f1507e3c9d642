"""The configuration file: what is refused and where, lines of keys, and edits that leave the rest as it is."""

from __future__ import annotations

import os
import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.command.config_edit import change, drop, put, put_all, verified
from handctl.command.config_file import Config, from_toml, is_name, key_checks, lines_of, parse, read_config, statements
from handctl.command.options import own_options, shared_options
from handctl.errors import OutputError, UsageError
from handctl.families import WIRES
from handctl.system.user_folders import config_path
from tests.support.each_row import each_row

CHECKS = key_checks()
FULL = (
    """\
# of this bench
port = "/dev/ttyUSB7"   # the old adapter
'retries' = 3

note-to-self.x = 1
""".replace("note-to-self.x = 1\n", "")
    + """\
# the left hand
[devices.left]  # worn
kind = "exo"
port = "/dev/ttyUSB0"   # by the window
# it was 1 before
id = 2

[ devices . "right" ]
kind = 'wrist'
port = '''
/dev/ttyUSB1'''
timeout = 1

# the end
"""
)
EXO = {"kind": "exo", "port": "/dev/ttyUSB5"}


def read(text: str) -> Config:
    return parse("c.toml", text)


def refused(text: str) -> str:
    with pytest.raises(UsageError) as caught:
        read(text)
    assert caught.value.exit_code == 2
    assert caught.value.hint
    return caught.value.text


# -- reading ----------------------------------------------------------------------------------------------------------


def test_every_value_with_its_line() -> None:
    config = read(FULL)
    assert {key: tuple(entry) for key, entry in config.values.items()} == {
        "port": ("/dev/ttyUSB7", 2), "retries": (3, 3),
    }  # fmt: skip
    left, right = config.devices.values()
    assert (left.name, left.kind, left.line) == ("left", "exo", 6)
    assert {key: tuple(entry) for key, entry in left.entries.items()} == {"port": ("/dev/ttyUSB0", 8), "id": (2, 10)}
    assert (right.name, right.kind, right.line) == ("right", "wrist", 12)
    assert {key: tuple(entry) for key, entry in right.entries.items()} == {
        "port": ("/dev/ttyUSB1", 14), "timeout": (1.0, 16),
    }  # fmt: skip


def test_a_missing_or_empty_file_is_empty(tmp_path: Path) -> None:
    assert read_config(str(tmp_path / "none.toml"))[1:4] == ("", {}, {})
    assert read("")[1:4] == ("", {}, {})
    assert read("# only words\n\n").values == {}


def test_every_shared_option_has_a_key() -> None:
    """All but `--assume-identity`, which must be typed."""
    options = shared_options(WIRES, own_options())
    names = {option.name for option in options} - {"assume_identity"}
    assert set(CHECKS) == names >= {"port", "device", "fake", "can", "format", "json", "dry_run", "yes", "debug"}
    assert "assume_identity" in {option.name for option in options}
    text = {
        "port": '"x"', "device": '"left"', "trace": '"t"', "output": '"o"', "format": '"csv"', "color": '"never"',
        "id": "5", "baud": "9600", "retries": "0", "timeout": "0.5", "deadline": "3",
        "model": '"tp"', "side": '"left"', "protocol": '"eb90"', "exchange": '"poll"', "poll_json": '"{}"', "tx_terminator": '"nul"', "history": '"off"', "facts": '"f"',
    }  # fmt: skip
    for name in names:
        value = text.get(str(name), "true")
        assert read(f"{name} = {value}").values[str(name)].value == from_toml(f"v = {value}")["v"]


@each_row(
    ("line", "words"),
    [
        ("prot = '/dev/ttyUSB0'", "prot"), ("retries = '3'", "whole number"), ("retries = 3.0", "whole number"),
        ("retries = true", "whole number"), ("retries = 101", "0 to 100"), ("retries = -1", "0 to 100"),
        ("baud = 0", "1 or more"), ("timeout = 0", "above 0"), ("timeout = nan", "finite"), ("timeout = inf", "finite"), ("timeout = 1e7", "above 0"),
        ("timeout = '1'", "number"), ("timeout = true", "number"), ("format = 'xml'", "'xml' is not one of"),
        ("format = 1", "text"), ("yes = 'true'", "true or false"), ("yes = 1", "true or false"), ("port = ''", "text"),
        ("port = 1", "text"), ("port = ['a']", "text"), ("id = 1979-05-27", "whole number"), ("[port]", "text"),
        ("[unknown]", "unknown"), ("devices = 1", "table"), ("devices.left = 1", "table"), ("[[devices]]", "table"),
        ("[devices.left]", "no kind"), ("[devices.'a b']", "'a b'"), ("[devices.'']", "''"),
        ("devices.l = {kind = 'exo'}", "no port"), ("devices.l = {kind = 'toaster', port = 'x'}", "toaster"),
        ("devices.l = {kind = ['exo'], port = 'x'}", "kind"), ("devices.l = {kind = 'exo', port = 3}", "port = 3"),
        ("devices.l = {kind = 'exo', port = 'x', yes = true}", "yes"),
        ("devices.l = {kind = 'exo', port = 'x', id = '1'}", "id = '1'"),
        ("port =", "not valid TOML"), ("port = x", "not valid TOML"), ("port = '''", "not valid TOML"),
        ("id = 1\nid = 2", "not valid TOML"), ("\ufeffid = 1", "not valid TOML"), ("id = " + "9" * 5000, "not valid TOML"),
        ("id = " + "[" * 5000, "not valid TOML"),
    ],
)  # fmt: skip
def test_what_cannot_be_understood_is_refused_with_its_line(line: str, words: str) -> None:
    text = refused(f"# first\n\n{line}\n")
    assert words in text
    if "nested too deeply" not in text and "5000" not in text and "Exceeds" not in text:
        assert text.startswith(("c.toml, line 3: ", "c.toml, line 4: ")), text


def test_how_the_aidin_hand_speaks_belongs_to_it() -> None:
    table = "[devices.a]\nkind = '{}'\nport = 'tcp://h'\nexchange = '{}'\n"
    assert read(table.format("aidin", "poll")).devices["a"].entries["exchange"] == ("poll", 4)
    assert "exchange = 'shout'" in refused(table.format("aidin", "shout"))
    assert "no such key of a device of family exo" in refused(table.format("exo", "poll"))


def test_a_near_word_is_offered() -> None:
    with pytest.raises(UsageError) as caught:
        read("time_out = 1")
    assert "Did you mean timeout?" in caught.value.hint


def test_a_file_that_is_not_utf_8_or_not_a_file(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_bytes(b'id = 1\nport = "\xff"\n')
    with pytest.raises(UsageError, match=r"c\.toml, line 2: byte FF is not UTF-8"):
        read_config(str(path))
    with pytest.raises(UsageError, match="cannot be read"):
        read_config(str(tmp_path))


def test_strings_hide_what_looks_like_toml() -> None:
    text = 'trace = """\n[devices.left]\n# no\n\\"""x""""\nport = \'#"[{\'\nid = 3 # ]\n[devices.l]\nkind="exo"\nport="[x]"'
    assert [(s.path, s.header, text.count("\n", 0, s.start) + 1) for s in statements(text)] == [
        (("trace",), False, 1), (("port",), False, 5), (("id",), False, 6), (("devices", "l"), True, 7),
        (("devices", "l", "kind"), False, 8), (("devices", "l", "port"), False, 9),
    ]  # fmt: skip
    assert read(text).values["trace"].value == '[devices.left]\n# no\n"""x"'
    assert lines_of('devices.a.port = 1\n\ndevices.b = {"c d" = {e = 1}}')[("devices", "b", "c d", "e")] == 3


@each_row(
    ("name", "good"),
    [("left", True), ("L-1_b", True), ("7", True), ("", False), ("a b", False), ("a.b", False), ("é", False),
     ("-d", False), ("a/b", False), ("a\n", False), (7, False)],
)  # fmt: skip
def test_names(name: object, good: bool) -> None:
    assert is_name(name) is good


# -- where it is ------------------------------------------------------------------------------------------------------


def test_the_xdg_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/k")
    for variable in ("HANDCTL_CONFIG", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(variable, raising=False)
    assert config_path() == "/home/k/.config/handctl/config.toml"
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative/is/invalid")
    assert config_path() == "/home/k/.config/handctl/config.toml"
    monkeypatch.setenv("XDG_CONFIG_HOME", "/x")
    assert config_path() == "/x/handctl/config.toml"
    monkeypatch.setenv("HANDCTL_CONFIG", "my.toml")
    assert config_path() == "my.toml"


# -- edits ------------------------------------------------------------------------------------------------------------


def test_a_new_table_comes_last() -> None:
    assert put(read(""), "a", EXO) == '[devices.a]\nkind = "exo"\nport = "/dev/ttyUSB5"\n'
    added = put(read(FULL), "a", {**EXO, "timeout": 0.5})
    assert added == FULL + '\n[devices.a]\nkind = "exo"\nport = "/dev/ttyUSB5"\ntimeout = 0.5\n'
    assert put(read("id = 1"), "a", EXO).startswith("id = 1\n\n[devices.a]\n")
    assert put(read("id = 1\r\n"), "a", EXO) == 'id = 1\r\n\r\n[devices.a]\r\nkind = "exo"\r\nport = "/dev/ttyUSB5"\r\n'


def test_a_present_table_is_replaced_line_by_line() -> None:
    changed = put(read(FULL), "left", {**EXO, "baud": 57600})
    assert changed == (
        FULL.replace('"/dev/ttyUSB0"   # by', '"/dev/ttyUSB5"   # by').replace("id = 2\n", "baud = 57600\n")
    )
    right = put(read(FULL), "right", {"kind": "wrist", "port": "can:socketcan:can0"})
    assert '[ devices . "right" ]\nkind = "wrist"\nport = "can:socketcan:can0"\n\n# the end\n' in right
    assert (
        put(read('[devices.a]\nkind="exo"\nport="x"'), "a", EXO) == '[devices.a]\nkind = "exo"\nport = "/dev/ttyUSB5"\n'
    )


def test_a_table_is_taken_out_and_nothing_else() -> None:
    assert drop(read(FULL), "left") == FULL.replace(
        '[devices.left]  # worn\nkind = "exo"\nport = "/dev/ttyUSB0"   # by the window\n# it was 1 before\nid = 2\n', ""
    )
    assert drop(read(FULL), "right").endswith("id = 2\n\n# the end\n")
    assert drop(read(FULL), "nobody") == FULL
    for text in ("", "id = 1\n", FULL, FULL.replace("\n", "\r\n")):
        assert drop(read(put(read(text), "new", EXO)), "new") == text


@each_row(
    "text",
    ["devices.a = {kind = 'exo', port = 'x'}\n", "devices.a.kind = 'exo'\ndevices.a.port = 'x'\n",
     "[devices]\na.kind = 'exo'\na.port = 'x'\n", "[devices]\na = {kind = 'exo', port = 'x'}\n"],
)  # fmt: skip
def test_a_device_that_is_written_otherwise_is_not_touched(text: str) -> None:
    config = read(text)
    assert config.devices["a"].kind == "exo"
    for edit in (lambda: put(config, "a", EXO), lambda: drop(config, "a")):
        with pytest.raises(UsageError, match=r"line \d: a is not written as one table"):
            edit()


def test_what_does_not_read_back_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(FULL)
    for text in (FULL, FULL + "[devices.a]\n", put(read(FULL), "a", EXO).replace("retries' = 3", "retries' = 4"),
                 put(read(drop(read(FULL), "left")), "a", EXO)):  # fmt: skip
        with pytest.raises(UsageError, match="cannot make this change without changing other entries"):
            change(str(path), lambda _config, text=text: text, EXO, "a")  # type: ignore[misc]
    inline = read("devices = {l = {kind = 'exo', port = 'x'}}\n")
    with pytest.raises(UsageError, match="cannot make this change without changing other entries"):
        verified(inline, put(inline, "a", EXO), EXO, "a")
    assert path.read_text() == FULL
    assert os.listdir(tmp_path) == ["c.toml"]


def test_several_names_are_written_at_once_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(FULL)
    put_all(str(path), {"left": EXO, "spare": EXO}, lambda config: None)
    devices = read(path.read_text()).devices
    assert list(devices) == ["left", "right", "spare"]
    assert [devices[name].entries["port"].value for name in ("left", "spare")] == ["/dev/ttyUSB5", "/dev/ttyUSB5"]
    before = path.read_text()

    def refuse(config: Config) -> None:
        raise UsageError(f"{len(config.devices)} devices")

    with pytest.raises(UsageError, match="3 devices"):
        put_all(str(path), {"more": EXO}, refuse)
    with pytest.raises(UsageError, match="without changing other entries"):
        put_all(str(path), {"more": EXO, "odd": {"kind": "exo"}}, lambda config: None)
    assert path.read_text() == before


def test_written_in_place_through_a_link_with_the_same_permissions(tmp_path: Path) -> None:
    real, link = tmp_path / "dotfiles" / "real.toml", tmp_path / "c.toml"
    real.parent.mkdir()
    real.write_text("id = 1\n")
    real.chmod(0o640)
    link.symlink_to(real)
    change(str(link), lambda config: put(config, "a", EXO), EXO, "a")
    assert link.is_symlink()
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert real.read_text() == 'id = 1\n\n[devices.a]\nkind = "exo"\nport = "/dev/ttyUSB5"\n'
    assert os.listdir(real.parent) == ["real.toml"]


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        change(str(tmp_path / "file" / "c.toml"), lambda config: put(config, "a", EXO), EXO, "a")


@pytest.mark.real
def test_of_two_edits_at_once_none_is_lost(tmp_path: Path) -> None:
    path = str(tmp_path / "c.toml")

    def add(name: str) -> None:
        change(path, lambda config: put(config, name, EXO), EXO, name)

    names = [f"d{number}" for number in range(6)]
    with ThreadPoolExecutor(len(names)) as pool:
        list(pool.map(add, names))
    assert sorted(read_config(path).devices) == names


TEXT = st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=12)
VALUES = st.fixed_dictionaries(
    {"kind": st.sampled_from(["exo", "wrist", "barrett"]), "port": TEXT},
    optional={"id": st.integers(-(10**9), 10**9), "timeout": st.floats(1e-6, 1e6), "retries": st.integers(0, 100)},
)


@given(
    st.sampled_from(["", FULL, "id = 1", FULL.replace("\n", "\r\n")]), st.sampled_from(["left", "right", "x-1"]), VALUES
)
def test_any_value_reads_back(text: str, name: str, values: dict[str, str | int | float]) -> None:
    config = read(text)
    new = verified(config, put(config, name, values), values, name)
    device = from_toml(new)["devices"][name]
    assert device == values
    without = verified(read(new), drop(read(new), name), {}, name)
    assert name not in from_toml(without).get("devices", {})
