"""`stop` of the library in the middle of a call of the same thread: where its question is answered, or in a signal handler."""

from __future__ import annotations

import threading
from typing import Any

import pytest

import handctl
from handctl.errors import STOPPED, Interrupted
from tests.support.cli import PATIENCE
from tests.support.each_row import each_row

ASKED: list[tuple[str, dict[str, Any], str, tuple[Any, ...], dict[str, Any]]] = [
    ("exo", {}, "position", (), {"index": 300}),
    ("exo", {}, "set", ({"position_set.index": 300},), {}),
    ("hand", {}, "angle", (), {"index": 300}),
    ("wrist", {}, "hand_write", (1486, "2C01"), {}),
    ("aidin", {}, "home", (), {}),
    ("barrett", {"initialized": 1}, "save", (), {}),
]


@each_row("family, options, method, args, named", ASKED)
def test_nothing_is_written_behind_a_stop_in_its_question(
    family: str, options: dict[str, Any], method: str, args: tuple[Any, ...], named: dict[str, Any]
) -> None:
    """The answer is yes, and comes after the stop."""
    with handctl.simulate(family, **options) as device:
        rows: list[Any] = []

        def ask(_question: str, _steps: list[Any]) -> bool:
            rows.extend(device.stop())
            return True

        with pytest.raises(Interrupted) as caught:
            getattr(device, method)(*args, confirm=ask, **named)
        assert caught.value.code == STOPPED and rows


@each_row("family, options, method, args, named", ASKED)
def test_a_stop_does_not_wait_for_an_answer_in_another_thread(
    family: str, options: dict[str, Any], method: str, args: tuple[Any, ...], named: dict[str, Any]
) -> None:
    """A question in a window, and the button that stops: nobody answers the question before, and the answer comes too late."""
    asked, stopped, ended = threading.Event(), threading.Event(), list[BaseException]()

    def ask(_question: str, _steps: list[Any]) -> bool:
        asked.set()
        return stopped.wait(PATIENCE)

    with handctl.simulate(family, **options) as device:

        def moves() -> None:
            try:
                getattr(device, method)(*args, confirm=ask, **named)
            except BaseException as exc:  # noqa: BLE001 - all that a thread ends with
                ended.append(exc)

        thread = threading.Thread(target=moves)
        thread.start()
        assert asked.wait(PATIENCE)
        assert device.stop()
        stopped.set()
        thread.join(PATIENCE)
        assert isinstance(ended[0], Interrupted) and ended[0].code == STOPPED, ended
        assert device.status()


@each_row("bound", [False, True])
def test_a_call_waits_for_the_stop_beside_it(bound: bool) -> None:
    """Else the replies of the two mix, and the device seems to go on."""
    with handctl.simulate("exo") as device:
        if bound:
            device.get("id")
        met, over, order = threading.Event(), threading.Event(), list[str]()

        def meets(what: str) -> None:
            order.append(what)
            met.set()

        class OnItsWay:
            """The turn of a stop that is not over."""

            def __enter__(self) -> None:
                meets("waits")
                over.wait(PATIENCE)

            def __exit__(self, *_: object) -> None: ...

        device._line._stops = OnItsWay()  # type: ignore[assignment]
        thread = threading.Thread(target=lambda: (device.get("id"), meets("ended")))
        thread.start()
        assert met.wait(PATIENCE) and order == ["waits"]
        over.set()
        thread.join(PATIENCE)
        assert order[-1] == "ended"
