"""Report what ended a command: every exception becomes one message on stderr, an envelope if asked for, and its exit code. Which code an error has stands in `errors`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import click

from handctl.command.command_tree import NoCommand, root
from handctl.command.options import words_of
from handctl.errors import HandctlError, Interrupted, OutputError, says_nothing_new


def typed_command(args: Sequence[str]) -> tuple[str, click.Command]:
    """The words of the line that name its command, and that command: values of options are none of them."""
    node: click.Command = root
    ctx = click.Context(root, info_name="handctl", **root.context_settings)
    names: list[str] = []
    words = iter(args)
    for word in words:
        takes = {name for param in node.get_params(ctx) if not getattr(param, "is_flag", False) for name in param.opts}
        if word.startswith("-"):
            if word in takes:
                next(words, "")
        elif isinstance(node, click.Group):
            found = node.get_command(ctx, word)
            if found is None:
                break
            node = found
            names.append(word)
    return " ".join(names), node


def report_and_exit_code(ended: BaseException, args: Sequence[str]) -> int:
    """How the command line `args` ended: one message on stderr for every error, and its exit code."""
    debug = "--debug" in args or bool(os.environ.get("HANDCTL_DEBUG"))
    streams, command = False, ""
    extra: dict[str, Any] = {}
    error: HandctlError
    try:
        raise ended
    except click.exceptions.Exit as exc:
        return exc.exit_code
    except (BrokenPipeError, SystemExit):
        return 0  # a closed pipe is quiet; click ends so when it meets one
    except OSError as exc:  # help that cannot be written; links and files translate their own
        error = OutputError(f"stdout cannot be written: {exc.strerror or exc}")
    except HandctlError as exc:
        error = exc
    except (click.Abort, KeyboardInterrupt):
        error = Interrupted()
    except NoCommand as exc:
        from handctl.command.terminal_prompts import print_stderr

        print_stderr(exc.format_message())
        return exc.exit_code
    except click.UsageError as exc:
        from handctl.command.envelope import from_click
        from handctl.command.suggestions import bare_link

        error = from_click(exc)
        if (link := bare_link(args)) and link in error.text:
            error.hint = f"write `-p {link}`"
        if exc.ctx is not None:
            streams = getattr(exc.ctx.command, "streams", False)
            extra = {"writes": []} if getattr(exc.ctx.command, "writes", False) else {}
            command = " ".join(words_of(exc.ctx))
    except click.ClickException as exc:
        error = HandctlError(exc.format_message(), hint=getattr(exc, "hint", ""))
        error.exit_code = exc.exit_code
    except Exception as exc:  # noqa: BLE001 - our own bug becomes exit code 1 and one message
        error = HandctlError(
            f"internal error: {type(exc).__name__}: {exc}",
            hint="this is a bug of handctl. Run the command again with --debug and report the output",
            code="internal",
        )
        error.__cause__ = exc
    from handctl.command.envelope import in_file, late_envelope
    from handctl.command.terminal_prompts import print_message, print_stderr

    if debug or in_file("debug"):
        import traceback

        print_stderr("".join(traceback.format_exception(error)).rstrip())
    if not error.shown:
        if not command:
            command, leaf = typed_command(args)
            streams = getattr(leaf, "streams", False)
            extra = {"writes": []} if getattr(leaf, "writes", False) and getattr(leaf, "family", None) else {}
        late_envelope(args, error, streams, command, extra)
    if not says_nothing_new(error):
        print_message("error", error.text, error.hint)
    return error.exit_code
