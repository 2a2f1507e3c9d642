"""Detect an AIDIN-hand: listen, and after silence send an empty object, which has no key and so commands nothing (dossier 6)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from handctl.devices.aidin.conversation import Conversation
from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.exchange_settings import ExchangeMode
from handctl.devices.aidin.remedies import REMEDIES
from handctl.link import ByteLink, Deadline
from handctl.model.check_rows import FAIL
from handctl.model.result import Journal, Row

WIRES = ("tcp",)
SPEEDS: tuple[int, ...] = ()
PING = "feedback"


def probe(
    link: ByteLink, journal: Journal, deadline: Deadline, ids: Sequence[int] = (1,), timeout: float | None = None
) -> list[Row]:
    """A row with the evidence. Raises NoAnswer, ProtocolError for other data."""
    conversation = Conversation(link, journal, timeout=timeout, retries=0, bound=deadline)
    conversation.connect()
    how = "streams" if conversation.exchange is ExchangeMode.STREAM else "replies to an empty object with"
    evidence = f"{how} {', '.join(sorted(conversation.feedback.seen))}"
    return [{"baud": None, "evidence": evidence}]


def ping(device: AidinHand) -> None:
    """Feedback that comes from now on: the answer to an empty object, or the next of its stream. Raises NoAnswer, ProtocolError."""
    device.conversation.refresh()


def further(device: AidinHand, answered: bool) -> Iterator[tuple[str, str, str, str]]:
    """Whether the feedback of a hand that has `answered` still changes."""
    if answered:
        status, evidence = device.liveness()
        yield "feedback", status, evidence, REMEDIES["frozen"].hint if status == FAIL else ""
