"""Interrupts (Ctrl-C, SIGTERM, hang-up): stop the device first, then show the result, and never wait for a sleeping reader.

The first interrupt raises KeyboardInterrupt wherever the command is, so that the device is stopped. From then on, stderr and
the trace are discarded as soon as they would have to wait: no stop waits for a reader. Once the command is done with the
device and only shows the result, an interrupt is no error any more: the reader has FINISH_SECONDS for the rest. A second
interrupt then ends the process, whatever is still open.

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

from handctl.system.waits import takes

ONE_INTERRUPT_SECONDS = 0.5
"""Ctrl-C pressed twice, or a hang-up followed by SIGTERM, is one interrupt: the second must not cut off the stop."""
FINISH_SECONDS = 0.6
"""How long a finished command waits for its reader after an interrupt."""
AGAIN_SECONDS = 0.2
"""How often it then checks what is still waiting; after a second interrupt it ends at the next check."""

Handler = Callable[[int, Any], None]


class _State:
    """The interrupts so far, and the outputs that must not wait for a reader."""

    def __init__(self) -> None:
        self.interrupt_count = 0
        self.last = float("-inf")
        self.left = False
        """Output was given up: its reader sleeps."""
        self.finishing = False
        """The device has been served: only a result is to be shown."""
        self.ringing = False
        self.handing: int | None = None
        """Descriptor that a piece of the result is just being handed to, -1 where that cannot take long."""
        self.kept = False
        """An interrupt came meanwhile."""
        self.stopping = 0
        """Stops that are running, one within the other."""
        self.asked: list[Callable[[], object]] = []
        """What answers those who wished for a stop meanwhile."""
        self.sending = False
        """A frame is just going out and being noted."""
        self.behind_frame: list[Callable[[], object]] = []
        """What a stop is to do once it has."""
        self.thread = get_ident()
        """The thread that handles interrupts."""
        self.results: set[int] = set()
        self.additional: set[int] = set()
        """Descriptors of pipes and terminals that take a result, and those that take a trace; without stdout and stderr."""

    def count_interrupt(self) -> bool:
        """Count a signal; False if it belongs to the interrupt before it. No stop waits for the reader of stderr or a trace."""
        for descriptor in (waits(sys.stderr), *self.additional):
            make_room(descriptor)
        from handctl.system import clock

        now = clock.now()
        new = now - self.last >= ONE_INTERRUPT_SECONDS
        if new:
            self.last = now
            self.interrupt_count += 1
        return new


_state = _State()


def was_interrupted() -> bool:
    """Whether this command has been interrupted."""
    return _state.interrupt_count > 0


def reset_interrupts() -> None:
    """An interrupt has been handled: the next signal counts as a new one, however soon it comes."""
    _state.last, _state.interrupt_count = float("-inf"), 0


def output_abandoned() -> bool:
    """Whether output was abandoned because its reader sleeps."""
    return _state.left


# -- signals ------------------------------------------------------------------------------------------------------


def end_on_signals(*, suspend: bool) -> bool:
    """From now on every interrupt raises KeyboardInterrupt; with `suspend` Ctrl-Z does too.

    SIGINT is taken even if it is ignored, as it is in a script's background job, which must be stoppable too. Whether one came
    behind the end of the line before, where it raises nothing: a script that does not look would go on as if nobody had pressed.
    """
    global _state
    from handctl.system import clock, signals  # noqa: F401 - all that the handler needs: it must not import

    before, _state = _state, _State()
    signals.take(_end, signals.numbers(suspend=suspend))
    signals.listen(_pressed)
    return before.finishing and before.interrupt_count > 0


def _end(_number: int, _frame: Any) -> None:
    new = _state.count_interrupt()
    if _state.finishing:
        _ring_soon()
    if not new or _state.finishing:
        return
    if _state.handing is not None and has_room(_state.handing):
        _state.kept = True  # raised as soon as that piece is out: a row is written and counted, or neither
        return
    raise KeyboardInterrupt


def device_done() -> None:
    """The command is done with the device: from now on an interrupt raises nothing.

    Call it as the last statement inside the handler of KeyboardInterrupt. `finish_on_signals` follows.
    """
    _state.finishing = True


def finish_on_signals() -> None:
    """From now on the command only closes the link and shows the result: an interrupt limits the wait for its reader.

    The link is closed once, and the result is written once and completely if someone reads it.
    """
    from handctl.system import signals

    device_done()
    signals.take(_end, signals.numbers(suspend=True), only_taken=True)
    if _state.interrupt_count > 1:
        _ring_soon()


def _pressed() -> None:
    """Called in another thread as well: the main thread may be waiting for the reader of a result."""
    if _state.finishing:
        _state.count_interrupt()
        _ring_soon()


def done(*, last: bool) -> None:
    """The command has finished: from now on signals change neither exit code nor stderr."""
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
        _state.count_interrupt()
        handler(number, frame)

    before = signals.take(told, signals.numbers(suspend=True))
    try:
        yield
    finally:
        signals.give_back(before)


@contextlib.contextmanager
def stopping() -> Iterator[None]:
    """Around a stop: the wish of another process for one waits until it is over, and does not break it off.

    Other threads than that of the command hear of no wish.
    """
    if get_ident() != _state.thread:
        yield
        return
    _state.stopping += 1
    try:
        yield
    finally:
        _state.stopping -= 1
        if not _state.stopping and _state.asked:
            with stopping():
                _state.asked.pop(0)()


def is_stopping() -> bool:
    """Whether a stop is running."""
    return _state.stopping > 0


def behind_stop(answer: Callable[[], object]) -> None:
    """`answer` is called once the stop that is running is over."""
    _state.asked.append(answer)


def _ring_soon() -> None:
    """Look a little later whether a reader holds up the end."""
    from handctl.system import signals

    if not _state.ringing:
        _state.ringing = True
        signals.look(_ring, max(FINISH_SECONDS, 0.001), AGAIN_SECONDS)


def _ring(_number: int, _frame: Any) -> None:
    twice = _state.interrupt_count > 1
    if twice and _state.left:
        os._exit(130)  # the device has been served, what there is to read has been given up: nothing is waited for
    if twice or not all(map(has_room, _writable())):
        _give_up()


# -- readers ------------------------------------------------------------------------------------------------------


def has_room(descriptor: int, seconds: float | None = 0.0) -> bool:
    """Wait until a pipe or a terminal accepts data, or its reader is gone; None = for ever. Interrupts are raised here."""
    return descriptor < 0 or takes(descriptor, seconds)


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
        (_state.results if result else _state.additional).add(descriptor)
    return descriptor


def forget(descriptor: int) -> None:
    """The file of this descriptor has been closed."""
    _state.results.discard(descriptor)
    _state.additional.discard(descriptor)


class handing_over:  # noqa: N801 - a context manager, named as one
    """Delay an interrupt until the chunk is written, unless the reader of the descriptor sleeps.

    So a piece is out and noted, or neither. A stop comes before a `frame` or behind it as well, never between the two halves of
    sending it: what sends looks in here whether it still may, so no frame that was begun before a stop goes out after it.
    Other threads than that of the command hear of no wish. Every frame passes here, so it is no generator.
    """

    __slots__ = ("_descriptor", "_frame", "_ours")

    def __init__(self, descriptor: int = -1, *, frame: bool = False) -> None:
        self._descriptor = descriptor
        self._ours = _state.handing is None and get_ident() == _state.thread
        self._frame = frame and self._ours

    def __enter__(self) -> None:
        if self._ours:
            _state.handing = self._descriptor
            _state.sending = self._frame

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if not self._ours:
            return
        _state.sending = False
        _state.handing = None
        try:
            if kind is None and _state.kept:
                _state.kept = False
                raise KeyboardInterrupt
        finally:
            while self._frame and _state.behind_frame:
                _state.behind_frame.pop(0)()


def waits_for_frame(stop: Callable[[], object]) -> bool:
    """Whether a frame is just going out: then `stop` is called as soon as it has. A line that takes nothing is not waited for."""
    if not _state.sending or (_state.handing is not None and not has_room(_state.handing)):
        return False
    _state.behind_frame.append(stop)
    return True


def _writable() -> set[int]:
    return {one for one in (waits(sys.stdout), waits(sys.stderr), *_state.results, *_state.additional) if one >= 0}


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
