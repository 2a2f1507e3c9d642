"""The way into the RealTime loop: LOOP, its echo and `*` (barrett §6.1). What is done inside is in loop.py."""

from __future__ import annotations

from handctl.devices.barrett.gcl.language import CR, DISTURBED, Answer, has_prompt, status_in
from handctl.devices.barrett.realtime.blocks import ACKNOWLEDGE
from handctl.devices.barrett.realtime.session import Session
from handctl.errors import ProtocolError

ENTER_SECONDS = 1.5


def enter(session: Session) -> None:
    """Send LOOP and wait for its acknowledgement; `session` then says that the hand is inside, or may be.

    Raises DeviceRefused with the hand's status, NoAnswer, ProtocolError.
    """
    hand, link, line = session.hand, session.hand.link, session.hand.line
    command = f"{session.wish.prefix}LOOP"
    sent = command.encode("ascii")
    deadline = line.deadline(ENTER_SECONDS + 2 * line.wire_seconds(len(sent) + 2))
    line.drain()
    # From here on it may be in the loop, where every byte counts as a header: it is left by ^C and nothing else.
    session.inside = session.asked = True
    session.mark = hand.journal.ledger.mark
    line.link.write(sent + CR, deadline)
    hand.journal.counters.sent += 1
    came, begun = b"", link.now()
    while not deadline.expired:
        if len(came) > len(sent) and came[len(sent)] == ACKNOWLEDGE and came[: len(sent)].upper() == sent:
            hand.journal.counters.received += 1
            session.decoder.feed(came[len(sent) + 1 :])
            return
        if has_prompt(came):
            if status := status_in(came):
                session.inside = session.asked = False
                raise hand.refusal(Answer(command, (), status, came))
            break
        chunk = line.link.read(deadline)
        if not chunk:
            break
        came = (came + chunk).lstrip(b" ")  # the space behind the prompt before may come late
    line.check_bound()
    if not came:
        raise line.unanswered(
            command, ENTER_SECONDS, begun, "check that the hand replies with `handctl barrett status`"
        )
    raise ProtocolError(
        f"{link.name}: expected {command} and *, or ERR, received {came[:48].hex(' ').upper()}",
        hint=DISTURBED,
        code="echo-differs",
    )
