"""Entry point: replaces closed standard streams, runs the root command, and handles a stdout that cannot be written.

`--version` is answered here and loads nothing; the commands, and what errors become as exit codes, are in `command.command_tree` and `command.report_errors`.
"""

from __future__ import annotations

import _signal  # type: ignore[import-not-found]  # the module signal makes enumerations of it, which takes longer than the rest
import gc
import os
import sys
from collections.abc import Sequence

from handctl import __version__

INTERRUPTED = 130
"""Exit code of Ctrl-C before anything has begun."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run handctl; returns the process exit code (cli contract, section 5)."""
    args = list(sys.argv[1:] if argv is None else argv)
    _occupy_streams()
    if args in (["--version"], ["-V"]):
        return _finish(0, f"handctl {__version__}\n")
    if argv is None:
        _end_on_ctrl_c()
        from handctl.lazy_stdlib import defer_unused_modules

        defer_unused_modules()
        gc.disable()  # until the command runs: what is imported stays, and looking through it costs a twentieth of the start
    from handctl.command.command_tree import root
    from handctl.interrupts import done
    from handctl.screen.sanitize import substitute_what_is_missing

    substitute_what_is_missing()
    try:
        if argv is None:
            _raise_on_ctrl_c()
        if "stop" in args and sum(word.startswith(("-d", "--device")) for word in args) > 1:
            from handctl.command.several_devices import joined_for_a_stop

            args = joined_for_a_stop(args)
        several = any("," in word or word.endswith("*") for word in args)
        if not (several and _on_several(args)):
            root.main(args=list(args), prog_name="handctl", standalone_mode=False)
        code = 0
    except BaseException as exc:  # noqa: BLE001 - what it does not know goes on
        from handctl.command.report_errors import report_and_exit_code

        code = report_and_exit_code(exc, args)
    code = _finish(code)
    done(last=argv is None)
    return code


def _end_on_ctrl_c() -> None:
    """While modules are loaded nothing has begun: Ctrl-C ends the process at once, instead of a traceback out of one of them."""
    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, lambda *_: os._exit(INTERRUPTED))


def _raise_on_ctrl_c() -> None:
    """As Python does it, unless Ctrl-C is ignored."""
    if _signal.getsignal(_signal.SIGINT) not in (_signal.SIG_IGN, None):
        _signal.signal(_signal.SIGINT, _signal.default_int_handler)


def _on_several(args: Sequence[str]) -> bool:
    """Run the command on each device where -d names several; whether it does."""
    from handctl.command import several_devices

    found = several_devices.devices_in(args)
    if found is not None:
        several_devices.run_on_each(args, found)
    return found is not None


def _occupy_streams() -> None:
    """Streams that were closed by the caller (`>&-`), which Python leaves out: else a device would be opened in their place.

    What is then written to stdout fails as on a full disk; stderr and stdin are empty.
    """
    for number, name, flags in ((0, "stdin", os.O_RDONLY), (1, "stdout", os.O_RDONLY), (2, "stderr", os.O_WRONLY)):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, flags)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            stream = open(number, "w" if number else "r", encoding="utf-8", closefd=False)  # noqa: SIM115 - to the end
            setattr(sys, name, stream)


def _finish(code: int, text: str = "") -> int:
    """Flush stdout while it can still be reported: a full disk is one line and not 0, a closed pipe is quiet."""
    try:
        if text:
            if hasattr(sys.stdout, "reconfigure"):
                sys.stdout.reconfigure(newline="\n")
            sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        _discard_stdout()
    except OSError as exc:
        _discard_stdout()
        if not code:  # else it, or what else went wrong, has been told already: one line
            sys.stderr.write(f"handctl: error: stdout cannot be written: {exc.strerror or exc}\n")
        return code or 1
    except KeyboardInterrupt:  # Ctrl-C into help that nobody reads
        _discard_stdout()
        return code or INTERRUPTED
    return code


def _discard_stdout() -> None:
    """What is still buffered must not fail a second time when the interpreter shuts down."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.close(null)
