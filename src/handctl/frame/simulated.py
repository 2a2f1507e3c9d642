"""Opens the link of a run. The simulated device of plain --fake is as earlier commands left it, or shown in use."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from handctl.errors import UsageError
from handctl.link import open_link

if TYPE_CHECKING:
    from handctl.frame.run import Run
    from handctl.link import Link
    from handctl.link.tap import Tap


def opened(run: Run, name: str, baud: int | None, tap: Tap | None) -> Link:
    """The LINK `name`, at `baud` if nothing else was asked for. Raises UsageError, LinkError."""
    family = run.family
    assert family is not None
    opening = partial(
        open_link,
        name,
        baud=run.settings.baud or baud or family.baud,
        tap=tap,
        tcp_port=family.tcp_port,
        exclusive=not run.stops,
    )
    if not run.settings.fake:
        return opening()
    from handctl.link.kept import Kept

    run.connection.kept = kept = Kept(name, writes=run.keeps)
    used = {"use": "on"} if run.in_use else {}
    try:
        link = opening(simulator={**kept.options(), **used})
    except UsageError as exc:
        if kept.before is None:
            raise
        reason = exc.text.removeprefix(f"{name}: ").removesuffix(". Remove it to start over")
        hint = "" if run.keeps else f"`handctl sim forget {kept.kind}` removes that file"
        run.journal.warn("kept", f"the simulated {kept.kind} starts over: {reason}", hint)
        kept.discard()
        link = opening(simulator={**kept.options(), **used})
    if run.keeps and not kept.path:
        from handctl.system.folders import HINT

        run.journal.info(
            "not-kept", f"the state of the simulated {kept.kind} is not saved: you own no folder for it", HINT
        )
    if kept.before is not None:
        run.journal.info("kept", kept.text)
    return link
