"""EEPROM saves: compared first, counted by serial number, refused when nothing changed (barrett §5.2.2, §5.2.3)."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from handctl.cli import main
from handctl.devices.barrett import eeprom_saves, state_files
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.line import Restarted
from handctl.errors import DeviceRefused, HandctlError, OutputError, ProtocolError, UsageError
from handctl.files import state_path
from tests.barrett.support import Simulated, changes, codes, simulated


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The journal of saves, in a state folder that does not exist yet."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "new" / "state"))
    return tmp_path / "new" / "state" / "handctl" / "barrett-saves.json"


def kept(state: Path) -> dict[str, dict]:
    return json.loads(state.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def saves(link: Simulated) -> list[str]:
    return [command for command in link.commands if "SAVE" in command]


def save(hand: BarrettHand, force: bool = False, simulated: bool = False) -> list[dict]:
    hand.link.fake = simulated
    return eeprom_saves.save(hand, force=force).rows


def test_where_the_journal_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert state_path(eeprom_saves.FILE) == tmp_path / "handctl" / "barrett-saves.json"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert state_path(eeprom_saves.FILE) == tmp_path / "home" / ".local" / "state" / "handctl" / "barrett-saves.json"


def test_the_first_save_saves_all_and_shows_what_is_no_default(state: Path) -> None:
    hand, link = simulated("")
    hand.write(changes("HSG.F1=150", "OTEMP=600"))
    link.sent.clear()
    rows = save(hand)
    assert saves(link) == ["FSAVE", "PSAVE"]
    assert {(row["name"], row["last_save"], row["value"], row["default"]) for row in rows} == {
        ("strain_limit_high.F1", None, 150, 256),
        ("strain_limit_high_alias.F1", None, 150, 256),
        ("over_temperature_limit", None, 600, 0),
    }
    assert kept(state)["1042"]["saves"] == 1
    assert len(kept(state)["1042"]["values"]) == 128
    assert codes(hand) == ["saves"]


def test_a_save_that_changes_nothing_is_refused(state: Path) -> None:
    hand, link = simulated("")
    save(hand)
    link.sent.clear()
    with pytest.raises(UsageError) as caught:
        save(hand)
    assert caught.value.exit_code == 2
    assert "--force" in caught.value.hint
    assert saves(link) == []
    assert kept(state)["1042"]["saves"] == 1


def test_what_another_program_saved_is_not_known(state: Path) -> None:
    """RAM is as handctl saved it, the EEPROM is not: no claim is made of it, and --force writes it."""
    hand, link = simulated("boot=0")
    hand.write(changes("DP.F2=5"))
    save(hand)
    for line in ("2FSET DP 77", "FSAVE", "2FSET DP 5"):
        hand.do(line)
    with pytest.raises(UsageError) as caught:
        save(hand)
    assert caught.value.code == "saved-already" and "nothing has changed" not in caught.value.text.lower()
    assert [row["before"] for row in save(hand, force=True)] in ([], [None])
    link.power_cycle()
    link.sleep(2.0)
    assert eeprom_saves.present(hand)["default_position.F2"] == 5


def test_force_saves_all_the_same(state: Path) -> None:
    hand, link = simulated("")
    save(hand)
    link.sent.clear()
    save(hand, force=True)
    assert saves(link) == ["FSAVE", "PSAVE"]
    assert kept(state)["1042"]["saves"] == 2


@pytest.mark.parametrize(("change", "verb"), [("DP.F2=5", "FSAVE"), ("LFT=1", "PSAVE")])
def test_only_what_changed_is_saved(change: str, verb: str, state: Path) -> None:
    hand, link = simulated("")
    save(hand)
    hand.write(changes(change))
    link.sent.clear()
    (row,) = save(hand)
    assert saves(link) == [verb]
    assert (row["last_save"], row["value"]) in ((8500, 5), (0, 1))
    assert kept(state)["1042"]["saves"] == 2


def test_each_hand_has_its_own_count(state: Path) -> None:
    state.parent.mkdir(parents=True)
    state.write_text(json.dumps({"7": {"saves": 4999, "values": {}}, "1042": {"saves": 41, "values": {"x": 1}}}))
    hand, _ = simulated("")
    save(hand)
    assert kept(state)["7"] == {"saves": 4999, "values": {}}
    assert kept(state)["1042"]["saves"] == 42
    (message,) = hand.journal.messages
    assert "42" in message.text and "5000" in message.text


def test_a_simulated_hand_does_not_count_for_a_real_one(state: Path) -> None:
    hand, _ = simulated("")
    save(hand, simulated=True)
    assert list(kept(state)) == ["simulated-1042"]


def test_saved_values_survive_a_power_cycle(state: Path) -> None:
    hand, link = simulated("boot=0")
    hand.write(changes("DP.F2=5", "LFT=1"))
    save(hand)
    link.power_cycle()
    link.sleep(2.0)
    assert eeprom_saves.present(hand)["default_position.F2"] == 5


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "5", "null", '"x"', '{"1042": 5}', '{"1042": []}', '{"1042": {"saves": "x"}}',
        '{"1042": {"saves": null}}', '{"1042": {"saves": 1, "values": 7}}', "\udcff",
    ],
)  # fmt: skip
def test_a_damaged_journal_is_refused_before_anything_is_saved(text: str, state: Path) -> None:
    state.parent.mkdir(parents=True)
    state.write_bytes(text.encode("utf-8", "surrogateescape"))
    before = state.read_bytes()
    hand, link = simulated("")
    with pytest.raises(UsageError) as caught:
        save(hand)
    assert str(state) in caught.value.text
    assert "move the file away" in caught.value.hint
    assert saves(link) == []
    assert state.read_bytes() == before


def test_the_journal_is_replaced_atomically(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state_files.store(state, eeprom_saves.WHAT, {"a": {"saves": 1}})
    assert [path.name for path in state.parent.iterdir()] == [state.name]
    seen: list[str] = []

    def replace(source: str, target: str) -> None:
        seen.append(Path(source).read_text(encoding="utf-8"))
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(OutputError) as caught:
        state_files.store(state, eeprom_saves.WHAT, {"b": {"saves": 2}})
    assert json.loads(seen[0]) == {"b": {"saves": 2}}
    assert kept(state) == {"a": {"saves": 1}}
    assert "No space left" in caught.value.text


def test_a_save_without_a_journal_is_told(state: Path) -> None:
    state.parent.parent.mkdir(parents=True)
    state.parent.write_text("a file where the folder should be")
    hand, link = simulated("")
    try:
        save(hand)
    except HandctlError:
        assert saves(link) == [], "refused: then nothing was saved"
    else:
        assert "journal" in codes(hand)


def test_a_save_that_failed_halfway_is_counted(state: Path) -> None:
    """FSAVE wrote the EEPROM, whatever PSAVE said (dossier 3.3: count own saves)."""
    hand, link = simulated("")
    ask = hand.line.ask

    def refuse_psave(command: str):  # type: ignore[no-untyped-def]
        return ask(command)._replace(status=128) if command == "PSAVE" else ask(command)

    hand.line.ask = refuse_psave  # type: ignore[method-assign]
    with pytest.raises(DeviceRefused):
        save(hand)
    assert saves(link) == ["FSAVE", "PSAVE"]
    assert kept(state)["1042"]["saves"] == 1


def test_a_save_with_a_spoiled_answer_is_no_success(state: Path) -> None:
    """`ERR 128` with a wrong bit is no prompt alone: it may or may not have been written (contract 5)."""
    hand, link = simulated("")
    ask = hand.line.ask
    hand.line.ask = lambda command, **_: (  # type: ignore[method-assign]
        ask(command)._replace(lines=("ER\ufffd 128",)) if command == "FSAVE" else ask(command)
    )
    with pytest.raises(ProtocolError) as caught:
        save(hand)
    assert caught.value.code == "bad-line" and "FSAVE" in caught.value.text
    assert saves(link) == ["FSAVE"]
    assert kept(state)["1042"] == {"saves": 1, "values": {}}


def test_a_save_that_was_kept_back_is_neither_counted_nor_claimed(state: Path) -> None:
    """The hand restarted after the values were read: FSAVE does not go out, and nobody says that it did."""
    hand, link = simulated("")
    ask = hand.line.ask

    def restart(command: str, **more: float):  # type: ignore[no-untyped-def]
        if command == "FSAVE":
            raise Restarted("the hand restarted; FSAVE was not sent")
        return ask(command, **more)

    hand.line.ask = restart  # type: ignore[method-assign]
    with pytest.raises(Restarted) as caught:
        save(hand)
    assert "was sent" not in caught.value.text and saves(link) == [] and not state.exists()


def test_a_refused_save_is_not_counted(state: Path) -> None:
    hand, _ = simulated("fault=refuse")
    with pytest.raises(DeviceRefused):
        save(hand)
    assert not state.exists()


@pytest.mark.parametrize("args", [["baud", "38400", "--save"], ["gcl", "FSAVE"], ["gcl", "PSAVE"]])
def test_every_save_of_handctl_is_counted(args: list[str], state: Path) -> None:
    assert main(["barrett", *args, "--yes", "-p", "fake://barrett?clock=virtual"]) == 0
    assert kept(state)["simulated-1042"]["saves"] == 1


def test_a_save_of_a_script_is_counted_although_a_later_command_fails(state: Path) -> None:
    port = "fake://barrett?clock=virtual&fault=hang&after=10"
    assert main(["barrett", "gcl", "FSAVE", "FGET P", "FGET P", "FGET P", "FGET P", "FGET P", "--yes", "-p", port]) == 5
    assert kept(state)["simulated-1042"] == {"saves": 1, "values": {}}


@pytest.mark.parametrize("yes", [False, True])
def test_another_speed_is_not_saved_by_accident(yes: bool, state: Path) -> None:
    port = "fake://barrett?clock=virtual&baud=38400"
    assert main(["barrett", "save", *(["--yes"] if yes else []), "-p", port]) == (2 if yes else 8)
    assert not state.exists()
    assert main(["barrett", "save", "--yes", "--force", "-p", port]) == 0


def test_default_of() -> None:
    assert eeprom_saves.default_of("init_velocity.SPREAD") == 150
    assert eeprom_saves.default_of("init_velocity.F1") == 300
    assert eeprom_saves.default_of("baud_rate") == 96


def test_a_serial_number_of_0_names_no_hand(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SN 0 is that of every hand upgraded in the field (§5.4.2): nothing is skipped or refused by another one's entry."""
    monkeypatch.setattr("handctl.sim.barrett.mechanics.SERIAL", 0)
    hand, link = simulated("")
    save(hand)
    save(hand)
    assert saves(link) == ["FSAVE", "PSAVE"] * 2
    assert kept(state)["0"]["saves"] == 2


def test_force_writes_both_halves_and_a_half_save_says_so(state: Path) -> None:
    hand, link = simulated("")
    save(hand)
    hand.write(changes("LFT=1"))
    link.sent.clear()
    save(hand)
    assert saves(link) == ["PSAVE"]
    assert "half" in codes(hand)
    hand.write(changes("LFT=0"))
    link.sent.clear()
    save(hand, force=True)
    assert saves(link) == ["FSAVE", "PSAVE"]
