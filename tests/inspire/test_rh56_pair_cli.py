"""`handctl hand pair` as it is typed: two names in the configuration file, on served simulators, at a terminal too."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from handctl.link import tcp
from handctl.sim.engine.serve import send_control
from tests.inspire.pairing_bench import Person
from tests.support.cli import Simulator, Spy, run, spying, wait_until
from tests.support.person import once, person
from tests.support.screen import Screen
from tests.support.terminal import Terminal

ONE, TWO = "fake://hand?model=df&clock=virtual", "fake://hand?model=tp&clock=virtual"
OLD = "tcp://192.168.11.210"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.toml"
    path.write_text("# of this bench\n", encoding="utf-8")
    return path


def typed(config: Path, *words: str | Path, **more: Any) -> Any:
    return run("hand", "pair", *words, env={"HANDCTL_CONFIG": str(config)}, **more)


def control(path: Path, command: str) -> str:
    answer = send_control(str(path), command)
    assert answer.startswith("ok "), answer
    return answer.removeprefix("ok ")


def moves(path: Path) -> int:
    """How often the hand behind this control socket was made to move."""
    (found,) = [word for word in control(path, "acts").replace(",", " ").split() if word.startswith("move=")]
    return int(found.removeprefix("move="))


# -- what is written, and what is refused ---------------------------------------------------------------------------------


def test_both_hands_are_named_and_can_be_used_by_name(config: Path) -> None:
    result = typed(config, ONE, TWO, "--first", "right", "--json")
    assert result.code == 0, result
    rows = [(row["name"], row["side"], row["link"], row["id"], row["model"]) for row in result.rows]
    assert rows == [("right", "right", ONE, 1, "df"), ("left", "left", TWO, 1, "tp")]
    assert config.read_text() == (
        "# of this bench\n\n"
        f'[devices.right]\nkind = "hand"\nport = "{ONE}"\nid = 1\nmodel = "df"\nside = "right"\n\n'
        f'[devices.left]\nkind = "hand"\nport = "{TWO}"\nid = 1\nmodel = "tp"\nside = "left"\n'
    )
    assert result.json["writes"] == []
    used = run("-d", "left", "hand", "get", "id", "--json", env={"HANDCTL_CONFIG": str(config)})
    assert (used.code, used.json["device"]["link"]) == (0, TWO)


def test_names_that_are_taken_are_refused_before_anything_is_opened(config: Path) -> None:
    assert typed(config, ONE, TWO, "--first", "left").code == 0
    before = config.read_text()
    result = typed(config, ONE, TWO, "--first", "right", "--json")
    assert (result.code, result.error["code"]) == (2, "name-taken")
    assert result.json["counters"]["sent"] == 0
    assert config.read_text() == before
    assert typed(config, ONE, TWO, "--first", "right", "--left", "one", "--right", "two").code == 0
    assert typed(config, ONE, TWO, "--first", "right", "--force").code == 0
    assert f'[devices.right]\nkind = "hand"\nport = "{ONE}"' in config.read_text()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((ONE, TWO, ONE), "3 LINKs given"),
        ((ONE, ONE), "give it only once"),
        ((ONE, "-p", TWO), "both as an argument and as an option"),
        ((ONE, "--fake"), "both as an argument and as an option"),
        ((ONE, TWO, "--left", "right"), "hands would have the same name"),
        ((ONE, TWO, "--left", "no name"), "cannot be the name of a device"),
        ((OLD, "--address", "127.0.0.1"), "is not the address of one device"),
        ((OLD, "--address", "x"), "is not an IPv4 address"),
        ((), "No device given"),
    ],
)
def test_what_cannot_be_meant_is_refused(config: Path, words: tuple[str, ...], text: str) -> None:
    result = typed(config, *words, "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0), result
    assert text in f"{result.error['text']} {result.error['hint'].casefold()}", result
    assert config.read_text() == "# of this bench\n"


@pytest.mark.parametrize("yes", [(), ("--yes",)])
def test_without_a_person_nothing_is_sent(config: Path, yes: tuple[str, ...]) -> None:
    """--yes answers what a question asks, not which hand has moved."""
    result = typed(config, ONE, TWO, *yes, "--json")
    assert (result.code, result.json["counters"]["sent"]) == (8, 0)
    assert "--first" in result.error["hint"]


def test_a_dry_run_shows_what_is_known(config: Path) -> None:
    result = typed(config, ONE, TWO, "-n", "--json")
    assert [row["bytes"] for row in result.rows] == ["EB 90 01 05 12 F8 05 64 00 79"]
    result = typed(config, ONE, "-n", "--first", "left", "--json")
    assert [row["bytes"] for row in result.rows] == ["EB 90 01 04 12 E8 03 02 04", "EB 90 01 04 12 ED 03 01 08"]
    result = typed(config, "tcp://192.168.11.210", "-n", "--address", "192.168.11.211", "--first", "left", "--json")
    assert [row["bytes"][18:] for row in result.rows] == ["FF 10 06 A4 00 02 04 A8 C0 D3 0B", "FF 06 03 ED 00 01"]


def test_a_generation_that_is_not_moved_is_not_named(config: Path) -> None:
    for model in ("f1", "dg2"):
        result = typed(config, ONE, f"fake://hand?model={model}&clock=virtual", "--first", "left", "--json")
        assert result.code == 6, result
    assert config.read_text() == "# of this bench\n"


# -- a person at a terminal ---------------------------------------------------------------------------------------------


def sit(config: Path, *words: str | Path, **more: Any) -> Screen:
    return person("hand", "pair", *words, columns=200, rows=50, env={"HANDCTL_CONFIG": str(config)}, **more)


def moved(spy: Spy) -> list[int]:
    """How often each of the two models was made to move."""
    hands = [line.device.hand for line in spy.lines]
    return [sum(hand.acts["move"] for hand in hands if hand.generation.name == name) for name in ("df", "tp")]


def test_a_person_sees_which_hand_moves_and_types_it(config: Path) -> None:
    with spying() as spy:
        seen: list[list[int]] = []

        def types(answer: str) -> Callable[[str], str]:
            return lambda _shown: (seen.append(moved(spy)), answer)[1]

        shown = sit(config, ONE, TWO, answers=[types("y"), types("right"), types("left")])
    assert shown.code == 0, shown.text
    assert seen == [[0, 0], [2, 0], [2, 2]]
    text = config.read_text()
    assert f'[devices.right]\nkind = "hand"\nport = "{ONE}"' in text
    assert f'[devices.left]\nkind = "hand"\nport = "{TWO}"' in text


@pytest.mark.parametrize(("answers", "code"), [(("n",), 8), (("y", "neither"), 8), (("y", "left", "left"), 7)])
def test_another_answer_names_nobody(config: Path, answers: tuple[str, ...], code: int) -> None:
    with spying() as spy:
        shown = sit(config, ONE, TWO, answers=answers)
    assert shown.code == code, shown.text
    assert "no hand is named" in shown.text.casefold()
    assert config.read_text() == "# of this bench\n"
    if answers == ("n",):
        assert moved(spy) == [0, 0]


def test_ctrl_c_in_the_movement_holds_both_hands_and_names_nobody(config: Path) -> None:
    with spying() as spy:
        shown = sit(config, ONE, TWO, answers=["y"], press=once(lambda seen: "Ctrl-C stops" in seen))
    assert shown.code == 130, shown.text
    assert "no hand is named" in shown.text.casefold()
    (line,) = [line for line in spy.lines if line.device.hand.acts["move"]]
    assert line.command("get 1522 12").split() == ["00"] * 12
    assert moved(spy)[1] == 0
    assert config.read_text() == "# of this bench\n"


@pytest.mark.real
def test_a_pair_that_is_killed_in_the_movement_stops_the_hand(config: Path, tmp_path: Path) -> None:
    controls = [tmp_path / f"{name}.sock" for name in ("one", "two")]
    with ExitStack() as stack:
        one, two = (
            stack.enter_context(Simulator("--pty", "--set", "model=df", "--control", each, kind="hand"))
            for each in controls
        )
        terminal = stack.enter_context(
            Terminal("hand", "pair", one.link, two.link, columns=200, env={"HANDCTL_CONFIG": str(config)})
        )
        terminal.until("[y/N]")
        terminal.send("y\n")
        wait_until(lambda: moves(controls[0]) == 1)
        terminal.process.kill(signal.SIGKILL)
        wait_until(lambda: control(controls[0], "get 1522 12").split() == ["00"] * 12)
        assert moves(controls[1]) == 0
    assert config.read_text() == "# of this bench\n"


# -- one IP address -----------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_two_hands_with_one_address_over_tcp(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The network is a table: whoever is on is behind its address, and both begin with the same one."""
    controls = [tmp_path / f"{name}.sock" for name in ("one", "two")]
    connect = tcp.connect
    where: dict[str, tuple[str, int]] = {}

    def connected(end: socket.socket, address: Any, seconds: float) -> None:
        if address[0].startswith("192.168.11."):
            if address[0] not in where:
                raise TimeoutError
            address = where[address[0]]
        connect(end, address, seconds)

    monkeypatch.setattr(tcp, "connect", connected)
    with ExitStack() as stack:
        hands = [
            stack.enter_context(Simulator("--modbus-tcp", "127.0.0.1:0", "--control", each, kind="hand"))
            for each in controls
        ]
        places = [("127.0.0.1", int(hand.link.rpartition(":")[2])) for hand in hands]

        def on(**now: int) -> Callable[[], None]:
            def switch() -> None:
                where.clear()
                where.update({f"192.168.11.{name[1:]}": places[number] for name, number in now.items()})

            return switch

        def cycled() -> None:
            control(controls[1], "power-cycle")
            on(_211=1)()

        on(_210=0)()
        person = Seeing(controls, [on(_210=1), cycled, on(_210=0, _211=1)])
        monkeypatch.setattr("handctl.command.settings_and_checks.TerminalPrompts", lambda _quiet: person)
        result = typed(config, OLD, "--json", "--yes")
    assert result.code == 0, result
    rows = [(row["name"], row["link"], row["network"]) for row in result.rows]
    assert rows == [("right", "tcp://192.168.11.211", "192.168.11.211"), ("left", OLD, "192.168.11.210")]
    assert 'port = "tcp://192.168.11.211"\nmodel = "tp"\nside = "right"' in config.read_text()


class Seeing(Person):
    """Sees which of two served hands moved: the first is the left one."""

    def __init__(self, controls: list[Path], acts: list[Callable[[], object]]) -> None:
        super().__init__({}, acts)
        self._controls = controls
        self._before = [0, 0]

    def moved(self) -> list[str]:
        now = [moves(path) for path in self._controls]
        moved = [name for name, is_now, was in zip(("left", "right"), now, self._before, strict=True) if is_now != was]
        self._before = now
        return moved
