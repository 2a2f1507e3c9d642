"""The completion: real shells with TAB pressed, every command and option against the click tree, and `handctl completion`.

What a shell that is not on this machine would show is checked in the text of its script instead: it names every
command, option and choice that bash offers.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

from handctl.command.command_tree import root
from handctl.docgen.completion_scripts import MARK, SHELLS
from handctl.docgen.read_command_tree import map_of
from handctl.families import COMMANDS, FAMILIES
from handctl.tools import completion as tool
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.shell import PRESENT, PROJECT, SCRIPTS, Terminal

BATCH = r"""
source "$1"
PATH=
compopt() {{ hints+=" ${{!#}}"; }}
while IFS= read -r COMP_LINE; do
    COMP_POINT=${{#COMP_LINE}}
    COMP_WORDBREAKS=' '
    read -ra COMP_WORDS <<<"$COMP_LINE"
    [[ $COMP_LINE == *' ' ]] && COMP_WORDS+=('')
    COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
    hints=
    _handctl handctl
    printf '%s|%s\n' "${{COMPREPLY[*]}}" "$hints"
done
"""


def offered(lines: list[str], script: Path = SCRIPTS["bash"], **env: str) -> list[tuple[list[str], str]]:
    """What bash would offer for each line, and the hints to readline. No program can be found meanwhile."""
    done = subprocess.run(
        [shutil.which("bash") or "bash", "--norc", "-c", BATCH.format(), "_", str(script)],
        input="".join(f"{line}\n" for line in lines), env={"LC_ALL": "C", **env}, capture_output=True, text=True,
        check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    answers = [answer.partition("|") for answer in done.stdout.splitlines()]
    assert len(answers) == len(lines)
    return [(words.split(), hints.strip()) for words, _, hints in answers]


def offer(line: str, **more: Any) -> list[str]:
    return offered([line], **more)[0][0]


def commands(command: click.Command = root, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Path, command and context of everything in the click tree."""
    ctx = click.Context(command, info_name="handctl", **command.context_settings)
    for name in path:
        ctx = click.Context(command, parent=ctx, info_name=name, help_option_names=["-h", "--help"])
    yield path, command, ctx
    if isinstance(command, click.Group):
        for name in command.list_commands(ctx):
            child = command.get_command(ctx, name)
            assert child is not None
            yield from commands(child, (*path, name))


TREE = list(commands())


def options_of(command: click.Command, ctx: click.Context) -> list[click.Option]:
    return [param for param in command.get_params(ctx) if isinstance(param, click.Option) and not param.hidden]


# -- bash, the whole tree -----------------------------------------------------------------------------------------


@pytest.mark.real
def test_bash_offers_every_command_and_every_option_of_the_tree() -> None:
    lines = [" ".join(("handctl", *path)) for path, _, _ in TREE]
    below = offered([f"{line} " for line in lines])
    dashes = offered([f"{line} -" for line in lines])
    for (path, command, ctx), (words, _), (options, _) in zip(TREE, below, dashes, strict=True):
        if isinstance(command, click.Group):
            assert words == command.list_commands(ctx), path
        names = [name for option in options_of(command, ctx) for name in (*option.opts, *option.secondary_opts)]
        assert sorted(options) == sorted(names), path


@pytest.mark.real
def test_bash_offers_every_fixed_choice() -> None:
    wanted = {
        " ".join(("handctl", *path, option.opts[-1], "")): [str(choice) for choice in option.type.choices]
        for path, command, ctx in TREE
        for option in options_of(command, ctx)
        if isinstance(option.type, click.Choice)
    }
    assert len(wanted) > 50
    for (line, choices), (words, _) in zip(wanted.items(), offered(list(wanted)), strict=True):
        assert words == choices, line
    assert offer("handctl completion ") == list(SHELLS)


@pytest.mark.real
@each_row("family", FAMILIES)
def test_names_and_elements_are_those_of_the_map(family: str) -> None:
    book = map_of(family)
    assert book is not None, f"the module of {family} has no map of its kind"
    params = book.every
    vector = next((param for param in params if param.elements and param.readable), params[0])
    lines = [f"handctl {family} {verb} " for verb in ("get", "watch", "describe")]
    (get, _), (watch, _), (describe, _), (elements, _) = offered([*lines, f"handctl {family} get {vector.name}."])
    short = {str(getattr(param, "mnemonic", "")) for param in params} - {""}
    assert set(get) - short == {param.name for param in params if param.readable} == set(watch) - short
    assert set(describe) - short == {param.name for param in params}
    assert elements == [f"{vector.name}.{part}" for part in vector.elements]
    if "set" in getattr(root.get_command(click.Context(root), family), "commands", {}):
        assert {word.rstrip("=") for word in offer(f"handctl {family} set ")} - short == {
            param.name for param in params if param.writable
        }


LINES = {
    "handctl --fake exo --format json du": ["dump"],
    "handctl --format table exo get force_actual.l": ["force_actual.little"],
    "handctl exo get system": ["system_voltage"],
    "handctl exo get system_voltage position_actual.in": ["position_actual.index"],
    "handctl exo get force_s": [
        "force_set", *(f"force_set.{finger}" for finger in ("little", "ring", "middle", "index", "thumb"))
    ],
    "handctl exo set baud": ["baud_code="],
    "handctl exo set baud_code=": ["baud_code=0", "baud_code=1", "baud_code=2"],
    "handctl exo set system": [],
    "handctl exo --format=c": ["--format=csv"],
    "handctl exo dump -qp fake://exo": ["fake://exo"],
    "handctl exo dump -p tc": ["tcp://"],
    "handctl barrett get SG.S": ["SG.SPREAD"],
    "handctl barrett firmware ch": ["check"],
    "handctl wrist status --ca": ["--can"],
    "handctl exo status --ca": [],
    "handctl exo dump -- --f": [],
    "handctl exo -o exo du": ["dump"],
    "handctl sim exo --fault over-": ["over-temperature", "over-current"],
    "handctl exo read ": [],
    "handctl nonsense ": list(COMMANDS),
}  # fmt: skip


@pytest.mark.real
def test_bash_line_by_line() -> None:
    assert dict(zip(LINES, [words for words, _ in offered(list(LINES))], strict=True)) == LINES


FILES = {
    "handctl exo snapshot ": "-o default",
    "handctl exo diff a.json ": "-o default",
    "handctl exo diff a.json b.json ": "",
    "handctl exo dump -o ": "-o default",
    "handctl exo dump --trace x -o ": "-o default",
    "handctl exo dump -p replay:": "-o default",
    "handctl exo dump -p ./": "-o default",
    "handctl exo dump --output=": "-o default",
    "handctl sim exo --state ": "-o default",
    "handctl exo id ": "",
}


@pytest.mark.real
def test_bash_leaves_files_to_readline_where_a_file_is_due() -> None:
    hints = [hint for _, hint in offered(list(FILES))]
    assert hints == ["default" if hint else "" for hint in FILES.values()]


CONFIG = """# [devices.commented]
format = "json"
[devices.left]
port = "/dev/ttyUSB0"
  [devices."right-hand"]
[devices.bench_2] # on the bench
[other.table]
"""


@pytest.mark.real
def test_named_devices_come_from_the_configuration_file(tmp_path: Path) -> None:
    script = tmp_path / "handctl"
    script.write_text(SCRIPTS["bash"].read_text().replace("-p --port", "-d --device").replace("-p=link", "-d=device"))
    config = tmp_path / "config" / "handctl" / "config.toml"
    config.parent.mkdir(parents=True)
    config.write_text(CONFIG)
    names = ["left", "right-hand", "bench_2"]
    assert offer("handctl exo dump -d ", script=script, XDG_CONFIG_HOME=str(tmp_path / "config")) == names
    assert offer("handctl -d r", script=script, XDG_CONFIG_HOME=str(tmp_path / "config")) == ["right-hand"]
    (tmp_path / ".config").mkdir()
    config.parent.rename(tmp_path / ".config" / "handctl")
    assert offer("handctl -d ", script=script, HOME=str(tmp_path)) == names
    assert offer("handctl -d ", script=script, HOME=str(tmp_path / "nowhere")) == []


@pytest.mark.real
def test_ports_are_those_of_the_machine(tmp_path: Path) -> None:
    devices = ("serial/by-id/usb-FTDI_X-if00-port0", "ttyUSB0", "ttyACM3", "rfcomm0")
    for name in (*devices, "tty1", "null"):
        path = tmp_path / "dev" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (tmp_path / "net" / "can0").mkdir(parents=True)
    (tmp_path / "net" / "eth0").mkdir()
    text = SCRIPTS["bash"].read_text().replace("/dev/", f"{tmp_path}/dev/").replace("/sys/class/net", f"{tmp_path}/net")
    script = tmp_path / "handctl"
    script.write_text(text)
    assert offer(f"handctl -p {tmp_path}", script=script) == [f"{tmp_path}/dev/{name}" for name in devices]
    assert offer("handctl wrist dump -p can:socketcan:", script=script) == ["can:socketcan:", "can:socketcan:can0"]
    assert offer("handctl wrist dump --port=can:slcan:/", script=script) == [
        f"--port=can:slcan:{tmp_path}/dev/{name}" for name in ("ttyACM3", "ttyUSB0")
    ]


# -- real shells --------------------------------------------------------------------------------------------------

PRESSED = {
    "handctl exo du": "handctl exo dump ",
    "handctl --fake exo get syst": "handctl --fake exo get system_voltage ",
    "handctl exo get position_actual.in": "handctl exo get position_actual.index ",
    "handctl exo set position_set.in": "handctl exo set position_set.index=",
    "handctl exo --format=j": "handctl exo --format=json ",
    "handctl exo --format j": "handctl exo --format json ",
    "handctl --form": "handctl --format ",
    "handctl exo dump -qp tc": "handctl exo dump -qp tcp://",
    "handctl exo dump --port=fake://ex": "handctl exo dump --port=fake://exo ",
    "handctl exo dump -p replay:bef": "handctl exo dump -p replay:before.json ",
    "handctl exo restore bef": "handctl exo restore before.json ",
    "handctl exo diff before.json aft": "handctl exo diff before.json after\\ all.json ",
    "handctl exo dump --output=bef": "handctl exo dump --output=before.json ",
    "handctl exo dump > bef": "handctl exo dump > before.json ",
    "handctl -p ./bef": "handctl -p ./before.json ",
    "handctl completion z": "handctl completion zsh ",
    "handctl.pyz wrist sta": "handctl.pyz wrist status ",
    "handctl exo read ": "handctl exo read ",
}


@pytest.mark.real
@pytest.mark.parametrize("shell", PRESENT)
def test_tab_in_a_real_shell(shell: str, tmp_path: Path) -> None:
    work = tmp_path / "work"
    work.mkdir()
    for name in ("before.json", "after all.json"):
        (work / name).touch()
    terminal = Terminal(shell, tmp_path / "home", cwd=work)
    try:
        assert {line: terminal.press(line).line for line in PRESSED} == PRESSED
        if shell != "fish":  # its pager draws the list below the prompt with cursor movements
            assert terminal.press("handctl exo --format ").listed[:6] == (
                "csv",
                "json",
                "ndjson",
                "openmetrics",
                "plain",
                "table",
            )
            assert set(COMMANDS) <= set(terminal.press("handctl ").listed)
        if shell == "bash":
            terminal.run("COMP_WORDBREAKS=$' \\t\\n'")
            assert terminal.press("handctl exo --format=j").line == "handctl exo --format=json "
            assert terminal.press("handctl exo set baud_code=").listed[:3] == (
                "baud_code=0", "baud_code=1", "baud_code=2"
            )  # fmt: skip
    finally:
        terminal.close()


@pytest.mark.real
@pytest.mark.parametrize("shell", PRESENT)
def test_tab_completes_a_named_device(shell: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "script"
    text = SCRIPTS[shell].read_text(encoding="utf-8")
    script.write_text(text.replace("-p=link", "-p=device").replace("-p link", "-p device"), encoding="utf-8")
    assert script.read_text(encoding="utf-8") != text
    monkeypatch.setitem(SCRIPTS, shell, script)
    config = tmp_path / "home" / ".config" / "handctl" / "config.toml"
    config.parent.mkdir(parents=True)
    config.write_text(CONFIG)
    terminal = Terminal(shell, tmp_path / "home")
    try:
        assert terminal.press("handctl -p r").line == "handctl -p right-hand "
        assert terminal.press("handctl exo dump -p be").line == "handctl exo dump -p bench_2 "
        assert terminal.press("handctl exo dump -p co").line == "handctl exo dump -p co"
    finally:
        terminal.close()


NODES = {
    "zsh": "compdef() {{ }}; source {script}; local -a cmds opts args; local -A takes\n",
    "fish": "source {script}; set cmds; set opts; set takes; set args; set shared\n",
}
NODE = {
    "zsh": "_handctl_node '{path}'; print -r -- ${{cmds%%:*}} '|' ${{opts%%:*}}\n",
    "fish": r"__handctl_node '{path}'; echo (string replace -r '\t.*' '' -- $cmds) '|' (string replace -r '\t.*' '' -- $opts)"
    "\n",
}


@pytest.mark.real
@pytest.mark.parametrize("shell", [shell for shell in PRESENT if shell != "bash"] or ["text"])
def test_zsh_and_fish_have_what_bash_has(shell: str) -> None:
    lines = [" ".join(("handctl", *path)) for path, _, _ in TREE]
    options = [sorted(words) for words, _ in offered([f"{line} -" for line in lines])]
    children = [command.list_commands(ctx) if isinstance(command, click.Group) else [] for _, command, ctx in TREE]
    if shell == "text":
        for script in (SCRIPTS["zsh"].read_text(), SCRIPTS["fish"].read_text()):
            assert all(word in script for words in (*options, *children) for word in words)
        return
    program = NODES[shell].format(script=SCRIPTS[shell])
    if shell == "zsh":
        program = (
            "check() { " + program + "".join(NODE[shell].format(path=" ".join(p)) for p, _, _ in TREE) + "}; check"
        )
    else:
        program += "".join(NODE[shell].format(path=" ".join(path)) for path, _, _ in TREE)
    flag = ["-f"] if shell == "zsh" else ["--no-config"]
    done = subprocess.run([shell, *flag, "-c", program], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    for (path, _, _), below, names, answer in zip(TREE, children, options, done.stdout.splitlines(), strict=True):
        commands_shown, _, options_shown = answer.partition("|")
        assert commands_shown.split() == below, path
        assert sorted(options_shown.split()) == names, path


def structure(text: str) -> list[str]:
    """Brackets that are open at the end of a PowerShell script, or closed too often; strings and comments left out."""
    bare = re.sub(r"'(?:[^']|'')*'|\"(?:[^\"])*\"|#[^\n]*", "", text)
    pairs, stack = {")": "(", "}": "{", "]": "["}, []
    for letter in bare:
        if letter in "({[":
            stack.append(letter)
        elif letter in pairs and (not stack or stack.pop() != pairs[letter]):
            return [*stack, letter]
    return stack


def test_powershell_has_what_bash_has() -> None:
    """There is no such shell here: its tables are compared with bash's, and its brackets counted."""
    text, bash = SCRIPTS["powershell"].read_text(encoding="utf-8"), SCRIPTS["bash"].read_text(encoding="utf-8")
    assert structure(text) == [] and structure(text.replace("}", "", 1)) != []
    assert "'" not in re.sub(r"'[^'\n]*'", "", re.sub(r"^\s*#.*$", "", text, flags=re.MULTILINE)), "every string ends"
    nodes = re.findall(r"^        '([a-z0-9 -]*)' \{ (\$found.*) \}$", text, re.MULTILINE)
    of_bash = dict(
        re.findall(
            r"^        (''|[a-z0-9-]+|'[a-z0-9 -]+')\) ((?:cmds|opts|takes|args|lacks)=.*) ;;$", bash, re.MULTILINE
        )
    )
    assert [name for name, _ in nodes] == [name.strip("'") for name in of_bash]
    for (name, told), there in zip(nodes, of_bash.values(), strict=True):
        keys = dict(re.findall(r"\$found\.([a-z]+) = '([^']*)'", told))
        assert keys == {
            key: quoted or plain
            for key, quoted, plain in re.findall(r"([a-z]+)=(?:'([^']*)'|(\S+))(?= [a-z]+=|$)", there)
        }, name
    assert all(f"fake://{family}" in text for family in FAMILIES) and "GetPortNames" in text


@pytest.mark.real
def test_the_bash_of_macos_has_no_compopt(tmp_path: Path) -> None:
    """Bash 3.2: a word is followed by a space of ours, files are readline's where nothing is offered."""
    program = 'enable -n compopt; source "$1"; COMP_LINE="handctl exo du"; COMP_POINT=14; COMP_WORDS=(handctl exo du); COMP_CWORD=2; '
    program += '_handctl; printf "<%s>" "${COMPREPLY[@]}"; complete -p handctl'
    done = subprocess.run(
        ["bash", "--norc", "-c", program, "_", SCRIPTS["bash"]], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "<dump >complete -o default -o nospace -F _handctl handctl\n"


@pytest.mark.real
def test_tab_takes_less_than_5_ms_in_bash(tmp_path: Path) -> None:
    terminal = Terminal("bash", tmp_path / "home")
    lines = {"handctl exo du": "mp ", "handctl exo get position_actual.in": "dex ", "handctl exo dump --dead": "line "}
    try:
        for line, rest in lines.items():
            taken: list[float] = []
            while (
                len(taken) < 400 and sum(seconds < 0.005 for seconds in taken) < 20
            ):  # a busy machine is late, never early
                terminal.child.send(line)
                terminal.child.expect_exact(line)
                start = time.perf_counter()
                terminal.child.send("\t")
                terminal.child.expect_exact(rest)
                taken.append(time.perf_counter() - start)
                terminal.child.sendline("")
                terminal.child.expect_exact("READY> ")
            assert sum(seconds < 0.005 for seconds in taken) >= 20, (line, sorted(taken)[:20])
    finally:
        terminal.close()


# -- handctl completion -------------------------------------------------------------------------------------------

PLACES = {
    "bash": "data/bash-completion/completions/handctl",
    "zsh": "data/zsh/site-functions/_handctl",
    "fish": "config/fish/completions/handctl.fish",
    "powershell": "data/handctl/handctl.ps1",
}


def places(home: Path) -> dict[str, str]:
    return {"HOME": str(home), "XDG_DATA_HOME": f"{home}/data", "XDG_CONFIG_HOME": f"{home}/config"}


def test_the_tool_knows_the_same_shells() -> None:
    assert tuple(SHELLS) == tool.SHELLS


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_prints_what_is_committed(shell: str, tmp_path: Path) -> None:
    committed = SCRIPTS[shell].read_text(encoding="utf-8")
    done = run("completion", shell)
    assert (done.code, done.out, done.err) == (0, committed, "")
    assert run("completion", shell, "-o", tmp_path / "x").out == ""
    assert (tmp_path / "x").read_text(encoding="utf-8") == committed
    assert run("completion", shell, "--json").rows == [{"shell": shell, "script": committed}]


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_installs_for_the_user(shell: str, tmp_path: Path) -> None:
    path = tmp_path / PLACES[shell]
    env = places(tmp_path)
    dry = run("completion", shell, "--install", "-n", env=env)
    assert dry.code == 0 and "nothing was written" in dry.err and not list(tmp_path.iterdir())
    done = run("completion", shell, "--install", "--json", env=env)
    assert done.rows == [{"shell": shell, "file": str(path), "result": "installed"}]
    assert done.codes() == ["next"]
    assert path.read_text(encoding="utf-8") == SCRIPTS[shell].read_text(encoding="utf-8")
    assert path.stat().st_mode & 0o777 == 0o644
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    assert run("completion", shell, "--install", "--json", env=env).rows[0]["result"] == "unchanged"
    path.write_text(f"# {MARK}, of another version\n")
    assert run("completion", shell, "--install", "--json", env=env).rows[0]["result"] == "replaced"
    assert path.read_text(encoding="utf-8") == SCRIPTS[shell].read_text(encoding="utf-8")


def test_completion_installs_below_home_without_xdg(tmp_path: Path) -> None:
    env = {"HOME": str(tmp_path), "XDG_DATA_HOME": "relative", "XDG_CONFIG_HOME": ""}
    for shell, place in (
        ("bash", ".local/share/bash-completion/completions/handctl"),
        ("zsh", ".local/share/zsh/site-functions/_handctl"),
        ("fish", ".config/fish/completions/handctl.fish"),
        ("powershell", ".local/share/handctl/handctl.ps1"),
    ):
        done = run("completion", shell, "--install", "--format", "plain", env=env)
        assert (done.code, done.out) == (0, f"{tmp_path / place}\n")
        assert (tmp_path / place).is_file()


def test_a_foreign_file_stays(tmp_path: Path) -> None:
    path = tmp_path / PLACES["bash"]
    path.parent.mkdir(parents=True)
    path.write_text("# mine\n")
    done = run("completion", "bash", "--install", "--json", env=places(tmp_path))
    assert (done.code, done.error["code"]) == (2, "foreign-file")
    assert path.read_text() == "# mine\n"


def test_a_place_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("a file where a directory should be")
    done = run("completion", "bash", "--install", env=places(tmp_path))
    assert done.code == 1 and done.err.count("handctl: error:") == 1 and str(tmp_path) in done.err


def test_what_cannot_be_is_refused() -> None:
    assert run("completion", "tcsh").code == 2
    assert run("completion").code == 2
    assert run("completion", "bash", "-n").code == 2


def test_the_scripts_start_no_program() -> None:
    for shell, path in SCRIPTS.items():
        text = path.read_text(encoding="utf-8")
        assert MARK in text.splitlines()[0] + text.splitlines()[1]
        code = "\n".join(line for line in text.splitlines() if ":" not in line and "\t" not in line)
        assert not any(word in code.split() for word in ("python", "python3", "sed", "awk", "grep", "ls", "cat")), shell


def test_the_committed_scripts_lie_where_the_project_says() -> None:
    lie = {shell: str(path.relative_to(PROJECT / "completions")) for shell, path in SCRIPTS.items()}
    assert lie == {name: shell.path for name, shell in SHELLS.items()}
