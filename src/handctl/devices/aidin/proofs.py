"""What the manual of the AIDIN-hand leaves open, as experiments (dossier 1, 2, 5, 6). See `model.proofs`.

What only reads has no mode: the hand is listened to, and where it wants to be asked, asked with the empty object.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from statistics import median

from handctl.devices.aidin import homing_and_bias, motion
from handctl.devices.aidin.conversation import ALL
from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.exchange_settings import LISTEN, ExchangeMode
from handctl.devices.aidin.json_codec import TERMINATORS, Decoder
from handctl.devices.aidin.parameter_map import AIDIN, ANGLES, ENCODERS, Target
from handctl.errors import CheckFailed, NoAnswer, ProtocolError
from handctl.model.frame_decoder import frames_in
from handctl.model.movement import ENDED
from handctl.model.prompts import Prompts
from handctl.model.proofs import MOVE, Disturbed, Observation, Proof
from handctl.wording import plural

WATCHED = 0.5
ROUNDS = 10
"""Times that every known key has come: what a stream looks like is seen in them."""
QUIET = 0.06
"""Seconds of silence behind an answer."""
MOST = 65536
KEYS = [f'"{key}"'.encode() for key in ALL]
ENDS = {b"\n": "newline", b"": "none", b"\0": "nul", b" ": "blank", b"\r\n": "crlf"}
FULL = 10
"""Decimals from which on a number is written as precisely as the hand has it: how many there are varies."""
FORGOTTEN = 1.2
EVEN = 0.8
"""Share of the gaps of a stream that are near their median."""
QUARTER = 1.570796
"""90 degrees in rad."""
MOTOR, NEAR_COUNTS, FAR_COUNTS, LEAST_COUNTS = "index.m1", 44000, 88000, 9000
"""Places of one motor, a tenth and a fifth of its stroke, and the counts by which it has moved, or is there."""
INDEX_Q3 = 6
ARRIVED = 2.0
"""Degrees within which a joint has arrived."""
RECONNECT = 3.0
NEAR = 0.002
"""rad by which q4 may differ from what it is compared with."""


def prepare(hand: AidinHand) -> None:
    """Find the terminator that a hand wants which answers objects, where it does not answer ours. Raises NoAnswer."""
    talk = hand.conversation
    given = talk.way
    try:
        talk.connect()
        return
    except NoAnswer as exc:
        failure = exc
    for end in TERMINATORS.values():
        talk.way = replace(given, end=end)
        try:
            talk.connect()
        except NoAnswer:
            continue
        return
    talk.way = given
    raise failure


def _came(hand: AidinHand, rounds: int = ROUNDS) -> bytes:
    """Text of the hand from one `{` on: its stream for some time or these `rounds`, or its answer to one object."""
    talk = hand.conversation
    streams = talk.exchange is ExchangeMode.STREAM
    talk.drain()
    if not streams:
        talk.send(talk.way.poll)
    link, came = talk.link, b""
    end = link.deadline(WATCHED if streams else talk.poll_seconds)
    while len(came) < MOST and (chunk := link.read(end)):
        came += chunk
        end = end if streams else link.deadline(QUIET)
        if streams and all(came.count(key) > rounds for key in KEYS):
            break
    if b"}" not in came:
        raise Disturbed("the hand sent no complete object")
    return came[came.index(b"{") :]


def _objects(hand: AidinHand, rounds: int = ROUNDS) -> list[dict[str, object]]:
    """The whole objects of that text. Raises ProtocolError where something else is between them."""
    decoder = Decoder()
    decoder.feed(_came(hand, rounds))
    damaged = list[ProtocolError]()
    found = list(frames_in(decoder, damaged.append))
    if damaged or not found:
        raise damaged[0] if damaged else Disturbed("the hand sent no complete object")
    return found


def _exchange(hand: AidinHand) -> Observation:
    talk = hand.conversation
    if talk.exchange is ExchangeMode.POLL:
        talk.drain()
        if talk.link.read(talk.link.deadline(LISTEN)):
            raise Disturbed("the hand also sends data without a request")
        return Observation("poll", "silent until it is asked, and answers an empty object")
    return Observation("stream", f"{plural(len(_objects(hand, MOST)), 'object')} came unasked in {WATCHED:g} s")


def _rate(hand: AidinHand) -> Observation:
    """The rate of a stream as it arrives, where its objects come evenly: lost or doubled ones make it uneven."""
    talk, times, key = hand.conversation, list[float](), f'"{ALL[0]}"'.encode()
    link = talk.link
    if talk.exchange is not ExchangeMode.STREAM:
        return Observation(None, "the hand sends nothing unasked")
    talk.drain()
    end, came = link.deadline(WATCHED), b""
    while chunk := link.read(end):
        came = (came + chunk)[-MOST:]
        count = came.count(key)
        times += [link.now()] * count
        came = came[came.rindex(key) + len(key) :] if count else came
    gaps = [later - earlier for earlier, later in pairwise(times)]
    middle = median(gaps) if gaps else 0.0
    even = sum(abs(gap - middle) <= middle / 2 for gap in gaps)
    if not middle or even < EVEN * len(gaps):
        return Observation(None, f"{plural(len(times), 'object')} in {WATCHED:g} s, not evenly")
    return Observation(
        round(1 / middle), f"{plural(len(times), 'object')} in {WATCHED:g} s, mostly {1000 * middle:.1f} ms apart"
    )


def _between(hand: AidinHand) -> Observation:
    text = _came(hand)
    found = set(re.findall(rb"\}([ \t\r\n\0]*)(?=\{)", text)) or {text[text.rindex(b"}") + 1 :]}
    if len(found) > 1:
        return Observation(None, f"more than one: {', '.join(map(repr, sorted(found)))}")
    (gap,) = found
    return Observation(ENDS.get(gap, gap.hex(" ").upper()), f"behind an object: {gap!r}")


def _keys(hand: AidinHand) -> Observation:
    keys = sorted({key for one in _objects(hand, MOST) for key in one})
    return Observation(", ".join(keys), plural(len(keys), "key"))


def _split(hand: AidinHand) -> Observation:
    most = max(len(set(one) & set(ALL)) for one in _objects(hand))
    return Observation(
        "one" if most == len(ALL) else "separate" if most == 1 else f"{plural(most, 'key')} each",
        f"up to {plural(most, 'key')} in an object",
    )


def _layout(hand: AidinHand) -> Observation:
    text = _came(hand)
    inside = text[: text.index(b"}")]
    return Observation(
        "indented" if b"\n" in inside else "blanks" if b'": ' in inside else "compact",
        repr(inside[:40].decode("ascii", "replace")),
    )


def _whole_numbers(hand: AidinHand) -> Observation:
    values = [value for one in _objects(hand) for value in _array(one, AIDIN["motor_pos"].key)]
    if not values:
        return Observation(None, "no encoders came")
    return Observation(
        "integers" if all(isinstance(value, int) for value in values) else "decimals", f"motor_pos {values[0]!r}"
    )


def _decimals(hand: AidinHand) -> Observation:
    found = re.search(rb'"joint_pos"\s*:\s*\[([^\]]*)\]', _came(hand))
    if found is None:
        return Observation(None, "no angles came")
    most = max(len(number.strip().partition(b".")[2]) for number in found[1].split(b","))
    return Observation("full" if most >= FULL else most, f"joint_pos: up to {most} decimals")


def _coupled(hand: AidinHand) -> Observation:
    """What q4 is beside q3, where all five fingers agree and no other answer fits as well."""
    angles = [value for one in _objects(hand) for value in _array(one, ANGLES_KEY)][:20]
    if len(angles) != 20:
        return Observation(None, "no angles came")
    pairs = [(angles[place + 2], angles[place + 3]) for place in range(0, 20, 4)]
    ways = [("same", 1.0, 0.0), ("half", 0.5, QUARTER), ("zero", 0.0, 0.0)]
    fits = [name for name, share, more in ways if all(abs(q4 - share * q3 - more) < NEAR for q3, q4 in pairs)]
    return Observation(fits[0] if len(fits) == 1 else None, f"thumb q3 {pairs[0][0]:.4f}, q4 {pairs[0][1]:.4f} rad")


def _array(one: dict[str, object], key: str) -> list[float]:
    found = one.get(key)
    return found if isinstance(found, list) else []


def _terminator(hand: AidinHand) -> Observation:
    """The first that is answered. Where none is needed, each is: ours comes first."""
    talk = hand.conversation
    if talk.exchange is not ExchangeMode.POLL:
        return Observation(None, "the hand is not asked, so it shows no terminator")
    given, answered = talk.way, list[str]()
    try:
        for name, end in TERMINATORS.items():
            talk.way = replace(given, end=end)
            if _answers(hand) or _answers(hand):
                answered.append(name)
    finally:
        talk.way = given
    return Observation(answered[0] if answered else None, f"answered behind {{}}: {', '.join(answered)}")


def _answers(hand: AidinHand) -> bool:
    """Whether an object comes to one. Behind silence half an object is given time to be forgotten."""
    try:
        return bool(_came(hand))
    except Disturbed:
        hand.conversation.link.sleep(FORGOTTEN)
        return False


# -- what moves ---------------------------------------------------------------------------------------------------------


def _went(hand: AidinHand, target: Target, text: str, prompts: Prompts) -> float:
    """Where the named element is after it was sent to its place, whether it arrived or not. Raises what the movement ends with."""
    (name,) = [text.partition("=")[0]]
    table = motion.move(hand, motion.parse(target, [text]), prompts, assume_homed=True, expect=ENDED)
    if table.failure is not None and not isinstance(table.failure, CheckFailed):
        raise table.failure
    (row,) = [row for row in table.rows if f"{row['finger']}.{row['element']}" == name]
    return float(row["value"])


def _homing_lasts(hand: AidinHand, prompts: Prompts) -> Observation:
    """Whether position commands still count in a connection in which the hand was not homed."""
    if not hand.conversation.reconnect(RECONNECT):  # asked before anything moves
        return Observation(None, "this link cannot be opened again")
    homed = homing_and_bias.home(hand, prompts)
    if homed.failure is not None and homed.failure.code != "homing-unproven":
        raise homed.failure
    before = _went(hand, ENCODERS, f"{MOTOR}={NEAR_COUNTS}", prompts)
    hand.conversation.reconnect(RECONNECT)
    after = _went(hand, ENCODERS, f"{MOTOR}={FAR_COUNTS}", prompts)
    _went(hand, ENCODERS, f"{MOTOR}=0", prompts)
    told = f"{MOTOR} went to {before:.0f} in the connection of the homing, and to {after:.0f} of {FAR_COUNTS} in the next one"
    if abs(before - NEAR_COUNTS) > LEAST_COUNTS:
        return Observation(None, f"{told}: it did not obey in the first one, either")
    return Observation("kept" if after - before > LEAST_COUNTS else "lost", told)


def _coupled_range(hand: AidinHand, prompts: Prompts) -> Observation:
    """q4 of the index finger at both ends of its q3."""
    homing_and_bias.check_homed(hand, assume=None)
    low, high = AIDIN["joint_pos"].limit(INDEX_Q3) or (0.0, 0.0)
    ends = []
    for place in (low, high):
        _went(hand, ANGLES, f"index.q3={place:g}", prompts)
        readings = hand.read(AIDIN["joint_pos"].each)
        ends.append([float(readings[index].value or 0.0) for index in (INDEX_Q3, INDEX_Q3 + 1)])
    told = ", ".join(f"q3 {q3:.1f} q4 {q4:.1f}" for q3, q4 in ends)
    if max(abs(q3 - place) for (q3, _), place in zip(ends, (low, high), strict=True)) > ARRIVED:
        return Observation(None, f"q3 did not arrive at its ends: {told}")
    first, last = (round(2 * q4) / 2 for _, q4 in ends)
    return Observation(f"{first:g} to {last:g}", f"index: {told} degrees")


ANGLES_KEY = "joint_pos"
PROOFS = (
    Proof("exchange", "not documented who speaks first (dossier 6)", (), "listen, then an empty object", _exchange),
    Proof("rate", "not documented (dossier 5, row 5)", (), "keys of the stream in half a second", _rate, measured=True),
    Proof("between-objects", "no delimiter is documented (dossier 1)", ("newline", "none", "nul", "blank", "crlf"), "what is between two objects, or behind one", _between),
    Proof("request-terminator", "no delimiter is documented (dossier 1)", "newline", "{} with newline, nothing, NUL and CR LF behind it: which is answered first", _terminator),
    Proof("keys", "five feedback keys (Feedback keys)", ", ".join(sorted(ALL)), "the keys that come", _keys),
    Proof("objects", "not documented whether all keys share an object (dossier 5, row 4)", ("one", "separate"), "keys in one object", _split),
    Proof("layout", "JSON, no more (TCP/IP information)", (), "spelling of an object", _layout),
    Proof("whole-numbers", "int for encoders and currents (Feedback keys)", "integers", "motor_pos: with a decimal point?", _whole_numbers),
    Proof("decimals", "double (Feedback keys)", (), "decimals of joint_pos", _decimals),
    Proof("q4", "q4 follows q3, and how is not documented (Ranges, dossier 4)", "same", "joint_pos: q4 against q3 of all fingers", _coupled),
    Proof(
        "homing-lasts", "not documented whether the homing belongs to the connection (dossier 2, Modes; 5, row 7)", "kept",
        "home, move index.m1, connect again, and move it once more", _homing_lasts, MOVE,
        question="All fingers OPEN for 3.5 s and drop any held object, then the index finger moves by a fifth of its stroke and back. Keep clear",
    ),
    Proof(
        "q4-range", "no range is documented for q4 (Ranges)", "115 to 175", "index.q3 to both ends of its range: q4 there", _coupled_range, MOVE,
        question="The index finger closes and opens over the whole range of q3. The hand must be homed. Keep clear",
    ),
)  # fmt: skip
