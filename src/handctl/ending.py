"""How a command ends when it is asked to: the device first, then the result, and never a wait for a reader that sleeps.

The first wish to end raises KeyboardInterrupt wherever the command is, so that a device is stopped. From then on what is
written beside the data (stderr, a trace) goes nowhere as soon as it would have to wait: no stop waits for a reader. Once
the device has been served and only the result is to be shown, a wish is no error any more: the reader has FINISH_SECONDS
for what is left of it. The second wish ends the process then, whatever is still open.

One process, one command: the state is that of this module. `system.signals` is imported when a command begins, not for help.
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
from _thread import get_ident
from collections.abc import Callable, Iterator
from typing import Any

ONE_WISH_SECONDS = 0.5
"""Ctrl-C pressed twice, or a hang-up with a SIGTERM behind it, is one wish: the second must not cut off the stop."""
FINISH_SECONDS = 0.6
"""How long a finished command waits for its reader once it is asked to end."""
AGAIN_SECONDS = 0.2
"""What still holds it up then is looked at this often; after a second wish it ends at the next look."""

Handler = Callable[[int, Any], None]


class _State:
    """What has been asked for, and what must not wait for anybody."""

    def __init__(self) -> None:
        self.wishes = 0
        self.last = float("-inf")
        self.left = False
        """Output was given up: its reader sleeps."""
        self.finishing = False
        """The device has been served: only a result is to be shown."""
        self.ringing = False
        self.handing: int | None = None
        """Descriptor that a piece of the result is just being handed to, -1 where that cannot take long."""
        self.kept = False
        """A wish came meanwhile."""
        self.thread = get_ident()
        """The thread that is told of a wish."""
        self.results: set[int] = set()
        self.beside: set[int] = set()
        """Descriptors of pipes and terminals that take a result, and those that take a trace; without stdout and stderr."""

    def wish(self) -> bool:
        """Count a signal; False when it belongs to the wish before it. No stop waits for who reads stderr or a trace."""
        for descriptor in (waits(sys.stderr), *self.beside):
            make_room(descriptor)
        from handctl.system import clock

        now = clock.now()
        new = now - self.last >= ONE_WISH_SECONDS
        if new:
            self.last = now
            self.wishes += 1
        return new


_state = _State()


def asked() -> bool:
    """Whether something has asked this command to end."""
    return _state.wishes > 0


def afresh() -> None:
    """A wish to end has been answered, and something new begins: the next signal is a wish of its own, however soon."""
    _state.last, _state.wishes = float("-inf"), 0


def gave_up() -> bool:
    """Whether output was given up because nobody read it."""
    return _state.left


# -- signals ------------------------------------------------------------------------------------------------------


def end_on_signals(*, suspend: bool) -> None:
    """From now on KeyboardInterrupt is raised, once a wish, by what asks the program to end; by Ctrl-Z too with `suspend`.

    SIGINT too: a script's background job starts with it ignored, and must be stoppable all the same.
    """
    from handctl.system import clock, signals, waits  # noqa: F401 - all that the handler needs: it must not import

    _state.__init__()  # type: ignore[misc]
    signals.take(_end, signals.numbers(suspend=suspend))
    signals.listen(_pressed)


def _end(_number: int, _frame: Any) -> None:
    new = _state.wish()
    if _state.finishing:
        _ring_soon()
    if not new or _state.finishing:
        return
    if _state.handing is not None and has_room(_state.handing):
        _state.kept = True  # raised as soon as that piece is out: a row is written and counted, or neither
        return
    raise KeyboardInterrupt


def served() -> None:
    """All that the command does to the device is done: from now on a wish raises nothing, in one step.

    The last statement of what answers to KeyboardInterrupt: behind it nobody would. `finish_on_signals` follows.
    """
    _state.finishing = True


def finish_on_signals() -> None:
    """From now on only the link is to be closed and a result to be shown: a wish to end bounds the wait for its reader.

    So the link is closed once, and a result, JSON above all, is there whole and once where somebody reads it.
    """
    from handctl.system import signals

    served()
    signals.take(_end, filter(signals.taken, signals.numbers(suspend=True)))
    if _state.wishes > 1:
        _ring_soon()


def _pressed() -> None:
    """Told beside the signal, in another thread: a result may wait for a reader, and the main thread with it."""
    if _state.finishing:
        _state.wish()
        _ring_soon()


def done(*, last: bool) -> None:
    """All is done and told: nobody is waited for; if the interpreter ends now, what comes changes neither exit code nor stderr."""
    if "handctl.system.signals" not in sys.modules:  # help: nothing was begun, and its start must not pay for this
        return
    from handctl.system import signals

    if _state.ringing:
        signals.no_alarm()
    if last:
        signals.ignore(signals.numbers())


@contextlib.contextmanager
def on_interrupt(handler: Handler) -> Iterator[None]:
    """Let `handler` take what asks the program to end."""
    import threading

    from handctl.system import signals

    if threading.current_thread() is not threading.main_thread():
        yield  # signals reach the main thread only
        return

    def told(number: int, frame: Any) -> None:
        _state.wish()
        handler(number, frame)

    before = signals.take(told, signals.numbers(suspend=True))
    try:
        yield
    finally:
        signals.give_back(before)


def _ring_soon() -> None:
    """Look a little later whether a reader holds up the end."""
    from handctl.system import signals

    if not _state.ringing:
        _state.ringing = True
        signals.look(_ring, max(FINISH_SECONDS, 0.001), AGAIN_SECONDS)


def _ring(_number: int, _frame: Any) -> None:
    twice = _state.wishes > 1
    if twice and _state.left:
        os._exit(130)  # the device has been served, what there is to read has been given up: nothing is waited for
    if twice or not all(map(has_room, _writable())):
        _give_up()


# -- readers ------------------------------------------------------------------------------------------------------


def has_room(descriptor: int, seconds: float | None = 0.0) -> bool:
    """Wait until a pipe or a terminal takes something, or its reader is gone; None = for ever. A wish to end is raised here."""
    from handctl.system import waits

    return descriptor < 0 or waits.takes(descriptor, seconds)


def make_room(descriptor: int) -> None:
    """What goes to this descriptor goes nowhere from now on, if it would have to wait for its reader."""
    if not has_room(descriptor):
        _discard(descriptor)


def waits(file: Any) -> int:
    """The descriptor of a file whose reader may sleep; -1 for a regular file, and for none of the system."""
    try:
        descriptor: int = file.fileno()
        return -1 if stat.S_ISREG(os.fstat(descriptor).st_mode) else descriptor
    except (OSError, ValueError, AttributeError):
        return -1


def watch(file: Any, *, result: bool) -> int:
    """Know of a file that a result or a trace is written to; its descriptor if its reader may sleep, or -1."""
    descriptor = waits(file)
    if descriptor >= 0:
        (_state.results if result else _state.beside).add(descriptor)
    return descriptor


def forget(descriptor: int) -> None:
    """The file of this descriptor has been closed."""
    _state.results.discard(descriptor)
    _state.beside.discard(descriptor)


@contextlib.contextmanager
def handing_over(descriptor: int = -1) -> Iterator[None]:
    """A wish that comes while a piece goes out takes effect behind it, unless the reader of the descriptor sleeps.

    So a piece is out and noted, or neither. Other threads than that of the command hear of no wish.
    """
    if _state.handing is not None or get_ident() != _state.thread:
        yield
        return
    _state.handing = descriptor
    try:
        yield
    finally:
        _state.handing = None
    if _state.kept:
        _state.kept = False
        raise KeyboardInterrupt


def _writable() -> set[int]:
    return {one for one in (waits(sys.stdout), waits(sys.stderr), *_state.results, *_state.beside) if one >= 0}


def _give_up() -> None:
    """Nothing is written any more where a reader sleeps: what waits there goes on at once, and ends."""
    _state.left = True
    for descriptor in _writable():
        if descriptor != waits(sys.stderr) or not has_room(descriptor):
            _discard(descriptor)


def _discard(descriptor: int) -> None:
    with contextlib.suppress(OSError):
        null = os.open(os.devnull, os.O_WRONLY)  # Python's own are closed in children
        os.dup2(null, descriptor, inheritable=descriptor < 3)
        os.close(null)
