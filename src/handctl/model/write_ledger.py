"""The record of writes of one command: which were planned, which were sent, and which were confirmed or refused.

It observes the link, not the commands: a family's `WriteRules` know which bytes write and what acknowledges them.
A device adds the evidence that is not an acknowledgement: a read-back, or its feedback. Knows no
protocol and does no I/O.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from handctl.fast_classes import NamedTuple
from handctl.model.frame_decoder import Decoder, frames_in
from handctl.wording import frame_text

if TYPE_CHECKING:
    from handctl.model.param import Step

NOT_SENT, SENT, CONFIRMED, REFUSED = "not-sent", "sent", "confirmed", "refused"
ACKNOWLEDGED = "acknowledged by the device"
IN_WORDS = {NOT_SENT: "not sent", SENT: "sent, unconfirmed", CONFIRMED: "confirmed", REFUSED: "refused"}
SHOWN_BYTES = 24
"""Bytes of a long frame that the text block shows; JSON has them all."""


F = TypeVar("F")
Addressee = tuple[str, int]
"""Family and id of a device on a line."""


class Frame(NamedTuple):
    """One writing frame among the bytes that went out.

    key       names it in its acknowledgement, None where the protocol has none
    same      equals that of the planned step that it is: its bytes without a running number
    group     frames of one group in a row are one step, as the 50 objects a second of a movement; "" = a step of its own
    unasked   counts only where it was planned, or behind one of its group that counts, as the ^C that a connection begins with
    meaning   what it says where its bytes alone do not show that; "" = they do
    next      what to do if nothing confirms it, where the bytes alone do not show that
    lasts     seconds that what it starts may last, if no command stops that, such as a calibration; 0 = nothing of the kind
    to        the device that it is addressed to, None where its bytes do not say that: it is that of the command
    new_id    the id that this device has once the frame is confirmed; 0 = it stays
    """

    data: bytes
    key: Hashable = None
    same: Hashable = None
    group: str = ""
    can_id: int | None = None
    unasked: bool = False
    meaning: str = ""
    next: str = ""
    lasts: float = 0.0
    to: Addressee | None = None
    new_id: int = 0


class WriteRules:
    """What a family knows of writing: stateful for one connection. Its `next` is pure. By itself it is a family that writes nothing."""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """The writing frames in bytes that have just gone out."""
        return ()

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """Keys of the frames that bytes of the device acknowledge (True) or refuse (False)."""
        return ()

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """The `same` of a planned step; None when it does not write."""
        return None

    def split(self, data: bytes, can_id: int | None) -> Sequence[bytes]:
        """The frames of a planned step, as `sent` will find them."""
        return (data,)

    def next(self, data: bytes, can_id: int | None) -> str:
        """What to read when nothing has confirmed this frame."""
        return ""

    def addressed(self, data: bytes, can_id: int | None) -> Collection[Addressee]:
        """The devices that a planned step is addressed to, as far as its bytes say that."""
        return ()


class RequestReplyRules(WriteRules, ABC, Generic[F]):
    """Those of a protocol without CAN, in which one request is out at a time and its answer names it.

    look   what to read when nothing has confirmed a write
    """

    look = ""

    def __init__(self) -> None:
        self._sent = b""
        self._decoder: Decoder[F] | None = None

    @abstractmethod
    def key(self, request: bytes) -> Hashable:
        """What its answer bears; None where the request writes nothing."""

    @abstractmethod
    def decoder(self, request: bytes) -> Decoder[F]:
        """For the answer to this request."""

    @abstractmethod
    def verdict(self, frame: F, request: bytes) -> tuple[Hashable, bool] | None:
        """Which key a frame of the device acknowledges (True) or refuses (False), None = none."""

    def same(self, request: bytes) -> Hashable:
        """The request without a running number."""
        return request

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteRules."""
        if (key := self.key(data)) is None:
            return ()
        self._sent, self._decoder = data, self.decoder(data)
        return (Frame(data, key, self.same(data)),)

    def came(self, data: bytes, can_id: int | None) -> Iterator[tuple[Hashable, bool]]:
        """See WriteRules."""
        assert self._decoder is not None
        self._decoder.feed(data)
        for frame in frames_in(self._decoder):
            if (verdict := self.verdict(frame, self._sent)) is not None:
                yield verdict

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteRules."""
        return self.same(data) if self.key(data) is not None else None

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        return self.look


class Write:
    """One step: planned, or seen on the wire, or both."""

    __slots__ = ("can_id", "count", "evidence", "frame", "last", "meaning", "missed", "named", "state", "words")

    def __init__(self, frame: Frame, meaning: str, state: str, words: WriteRules | None) -> None:
        self.words = words  # a stop may go on to another device, in the words of its family
        self.frame = frame
        self.meaning = meaning
        self.state = state
        self.last = frame.data
        self.count = 1
        self.missed = 0
        self.named = False
        self.evidence = ""

    def again(self, data: bytes) -> None:
        """The next frame of the same group."""
        self.missed += self.state != CONFIRMED
        self.count += 1
        self.last = data
        self.state = SENT


class Ledger:
    """All writes of one command. Without `words` nothing is seen, as in a test of a single part.

    explain   bytes -> what they say, for steps that no plan has: a stop after Ctrl-C, an id
    """

    def __init__(self) -> None:
        self.words: WriteRules | None = None
        self.explain: Any = None
        self._plan: list[tuple[Hashable, Step]] = []
        self._writes: list[Write] = []
        self._waiting: dict[Hashable, Write] = {}
        self._one_step: Frame | None = None
        self._repeats = False
        self.unstoppable: Callable[[Addressee | None, float], object] = lambda to, seconds: None
        """Called where something begins on a device that no command stops, with the seconds that it may last; with 0 when it is over."""
        self.moving: Callable[[Addressee | None, bool], object] = lambda to, moving: None
        """Called where the first write goes out that moves a device, and where a stop of it was acknowledged (False)."""
        self.renamed: Callable[[Addressee, Addressee], object] = lambda before, after: None
        """Called where a device is shown to have another id than before."""
        self.drives = False
        """What is written from now on moves the device, whatever the plan says: it may go on to a target that it holds."""
        self.going: list[Addressee | None] = []
        """What the writes have set going and no stop was acknowledged of since; None = the device of the command."""
        self.meant: dict[Addressee, None] = {}
        """What the planned steps that move something are addressed to."""
        self.halted: set[Addressee | None] = set()
        """What the last stop went out to."""
        self.names: list[tuple[Addressee, Addressee]] = []
        """Each change of an id that was shown, before and after."""
        self._stops: set[Hashable] = set()  # the planned steps that stop the device
        self._moves = False  # whether any step that was planned moves the device
        self._asked: set[Hashable] = set()  # what of the plan went out, and the groups of what counts

    # -- what is meant -------------------------------------------------------------------------------------------

    def plan(self, steps: Sequence[Step]) -> None:
        """What the command is going to write, in order. Steps that it has named before are not counted twice."""
        known = [same for same, _ in self._plan]
        self._moves = self._moves or any(step.moves for step in steps)
        parts = [part for step in steps for part in self._parts(step)]
        for step in parts:
            same = self.words.planned(step.data, step.can_id) if self.words is not None else step.data
            if same in known:
                known.remove(same)
            elif same is not None:
                self._plan.append((same, step))
                if self._repeats:
                    self._stops.add(same)
            if step.moves and not self._repeats and self.words is not None:
                self.meant.update(dict.fromkeys(self.words.addressed(step.data, step.can_id)))

    def _parts(self, step: Step) -> Sequence[Step]:
        """A step of several frames as these: the wire shows each by itself, and each says what it means."""
        found = self.words.split(step.data, step.can_id) if self.words is not None else ()
        return [step._replace(data=data, meaning="") for data in found] if len(found) > 1 else (step,)

    def forget(self) -> None:
        """What was planned and has not gone out will not: the device is on another wire, in other bytes."""
        self._plan.clear()

    # -- what passed on the wire ---------------------------------------------------------------------------------

    def opened(self, now: float) -> None:
        """See link.transcript.Observer."""

    def event(self, now: float, text: str) -> None:
        """See link.transcript.Observer."""

    def passed(self, now: float, mark: str, data: bytes, can_id: int | None) -> None:
        """Bytes as they passed (see link.transcript.Observer). Never raises: a stop must reach the wire whatever this finds."""
        if self.words is None:
            return
        try:
            if mark == ">":
                for frame in [self._one_step._replace(data=data)] if self._one_step else self.words.sent(data, can_id):
                    self._note(frame)
            elif self._waiting:
                for key, accepted in self.words.came(data, can_id):
                    self._judge(key, accepted)
        except Exception:  # noqa: BLE001 - bytes that a family's words do not know, of which nothing is claimed
            if mark == ">":
                self._note(Frame(data, can_id=can_id))

    @contextmanager
    def one_step(self, meaning: str, then: str) -> Iterator[None]:
        """Everything that goes out in here is one step, whatever its bytes look like: an image for a boot monitor.

        `then`: what to do if nothing confirms it.
        """
        self._one_step = Frame(b"", group=meaning, meaning=meaning, next=then)
        try:
            yield
        finally:
            self._one_step = None

    @contextmanager
    def stopping(self) -> Iterator[None]:
        """Around a stop: the same frame once more is the same step, since it is sent until one of them is acknowledged.

        What it plans and does not send is no remaining step of the command. It is not even planned where the stop is interrupted:
        the device was stopped before, and the link sends nothing more.
        """
        before, self._repeats = self._repeats, True
        self.halted = set()
        planned = list(self._plan)
        try:
            yield
        except KeyboardInterrupt:
            self._plan = [one for one in self._plan if one in planned]
            raise
        finally:
            self._repeats = before

    def _note(self, frame: Frame) -> None:
        if frame.lasts:
            self.unstoppable(frame.to, frame.lasts)
        planned = self._planned(frame.same)
        # ^C has other bytes at another speed, and may be repeated behind one that ended a movement.
        asked = (frame.group if frame.unasked and frame.group else frame.same) in self._asked
        if planned is not None:
            self._asked.add(frame.same)
        elif frame.unasked and not asked:
            return
        self._asked.add(frame.group)
        # Of one that no plan has it is not known whether it moves.
        moves = self.drives or (planned.moves if planned is not None else not asked)
        if self._repeats:
            self.halted.add(frame.to)
        elif moves and frame.to not in self.going:
            self.going.append(frame.to)
            self.moving(frame.to, True)
        last = self._writes[-1] if self._writes else None
        if self._repeats and last is not None and frame.same is not None and last.frame.same == frame.same:
            last.count += 1
        elif last is not None and frame.group and last.frame.group == frame.group:
            last.again(frame.data)
            last.meaning = last.meaning or (planned.meaning if planned is not None else "")
        else:
            last = Write(frame, planned.meaning if planned is not None else "", SENT, self.words)
            self._writes.append(last)
        if frame.key is not None:
            self._waiting[frame.key] = last

    def stopped(self) -> None:
        """The last stop was acknowledged."""
        self.drives = False
        for to in self.halted or (None,):
            self.going = [one for one in self.going if one != to]
            self.moving(to, False)

    def _planned(self, same: Hashable) -> Step | None:
        """Takes the step out of the plan: it went out."""
        for place, (known, step) in enumerate(self._plan):
            if known == same:
                del self._plan[place]
                return step
        return None

    def _judge(self, key: Hashable, accepted: bool) -> None:
        write = self._waiting.get(key)
        if write is not None:
            write.state = CONFIRMED if accepted else REFUSED
            write.evidence = ACKNOWLEDGED if accepted else "refused by the device"
            self._name(write, accepted)

    def _name(self, write: Write, confirmed: bool) -> None:
        """The device that this was written to has the new id, or has it no longer; where the frame gives it one."""
        to = write.frame.to
        if to is None or not write.frame.new_id or confirmed == write.named:
            return
        write.named, new = confirmed, (to[0], write.frame.new_id)
        before, after = (to, new) if confirmed else (new, to)
        self.going = [after if one == before else one for one in self.going]
        self.names.append((before, after))
        self.renamed(before, after)

    # -- what a device adds --------------------------------------------------------------------------------------

    @property
    def mark(self) -> int:
        """A place in the ledger: what is written from here on."""
        return len(self._writes)

    def confirm(self, evidence: str, *steps: Step, since: int = 0) -> None:
        """`evidence`, as "read back", proves these `steps`; without any, everything that was sent since the mark `since`."""
        for write in self._chosen(steps, since):
            if write.state == SENT or steps:
                write.state, write.evidence, write.missed = CONFIRMED, evidence, 0
                self._name(write, True)

    def doubt(self, evidence: str, *steps: Step, since: int = 0) -> None:
        """`evidence`, as "reads 200", speaks against what these `steps` should have done, acknowledged or not."""
        for write in self._chosen(steps, since):
            if write.state != REFUSED:
                write.state, write.evidence = SENT, evidence
                self._name(write, False)

    def refuse(self, evidence: str, *steps: Step) -> None:
        """`evidence` shows that the device has done nothing of these `steps`."""
        for write in self._chosen(steps, 0):
            write.state, write.evidence = REFUSED, evidence

    def _chosen(self, steps: Sequence[Step], since: int) -> list[Write]:
        if not steps or self.words is None:
            return self._writes[since:]
        wanted = [self.words.planned(step.data, step.can_id) for step in steps]
        return [write for write in self._writes[since:] if write.frame.same in wanted]

    # -- what it says --------------------------------------------------------------------------------------------

    @property
    def began(self) -> bool:
        """Whether any byte of a write went out."""
        return bool(self._writes)

    @property
    def unconfirmed(self) -> bool:
        """Whether something went out and nothing shows what became of it, or a step of a stop behind it did not go out."""
        unsent = self.began and any(same in self._stops for same, _ in self._plan)
        return unsent or any(self._state(write) == SENT for write in self._writes)

    @staticmethod
    def _state(write: Write) -> str:
        return SENT if write.missed and write.state == CONFIRMED else write.state

    def rows(self) -> list[dict[str, Any]]:
        """One object a step (cli contract, section 4): what went out in its order, then what is left of the plan."""
        rows = [self._row(write) for write in self._writes]
        rows += [
            {"bytes": step.wire, "meaning": step.meaning or self._meaning(step), "state": NOT_SENT, "next": ""}
            for _, step in self._plan
        ]
        return [{"step": number, **row} for number, row in enumerate(rows, 1)]

    def _row(self, write: Write) -> dict[str, Any]:
        state, frame = self._state(write), write.frame
        row: dict[str, Any] = {
            "bytes": frame_text(frame.data, frame.can_id),
            "meaning": write.meaning or frame.meaning or self._meaning(frame),
            "state": state,
            "next": frame.next or write.words.next(frame.data, frame.can_id)
            if state == SENT and write.words is not None
            else "",
        }
        if write.evidence:
            row["evidence"] = write.evidence
        if write.count > 1:
            row |= {"count": write.count, "last": frame_text(write.last, frame.can_id)}
        return row

    def _meaning(self, frame: Frame | Step) -> str:
        return self.explain(frame.data, frame.can_id) if self.explain is not None else ""

    def text(self) -> list[str]:
        """The block for people: one line when all is confirmed, else one line a step."""
        rows = self.rows()
        if not rows:
            return []
        found = {state: sum(row["state"] == state for row in rows) for state in IN_WORDS}
        if found[NOT_SENT] == len(rows):
            return [f"writes: none of {len(rows)} {'steps' if len(rows) > 1 else 'step'} was sent"]
        told = ", ".join(f"{count} {IN_WORDS[state]}" for state, count in found.items() if count)
        if found[CONFIRMED] == len(rows):
            return [f"writes: {told}"]
        lines = [f"writes: {told}", *(line for row in rows for line in _lines(row))]
        plan = enumerate(self._plan, len(self._writes) + 1)
        left = ", ".join(str(number) for number, (same, _) in plan if same not in self._stops)
        if left and found[SENT]:
            lines.append(
                f"  to continue: check the position of the device, then run the command again. Do not send the remaining steps (step {left}) on their own, because they are part of a movement"
                if self._moves
                else f"  to continue: read the unconfirmed values, then send the remaining steps (step {left})"
            )
        return lines


def _lines(row: dict[str, Any]) -> list[str]:
    words = row["bytes"].split(" ")
    cut = " ".join(words[:SHOWN_BYTES]) + (f" … ({len(words)} bytes)" if len(words) > SHOWN_BYTES else "")
    same = row.get("last") == row["bytes"]
    times = (f", {row['count']} times" if same else f", in {row['count']} parts, the first") if "count" in row else ""
    why = f" ({row['evidence']})" if row.get("evidence") and row["state"] != CONFIRMED else ""
    line = f"  {row['step']}  {IN_WORDS[row['state']]}{why}: {row['meaning'] or 'bytes'}{times}: {cut}"
    return [line, *([f"     Next: {row['next']}"] if row["next"] else [])]
