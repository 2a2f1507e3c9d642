"""The error tree. Each error names a meaning and carries the process exit code that goes with it.

    HandctlError (1)
    ├── UsageError      2  impossible request; nothing was sent
    ├── LinkError       3  cannot be opened, busy, not permitted, lost
    ├── NoAnswer        4  silence until the deadline
    ├── ProtocolError   5  data arrived, but no valid reply
    ├── DeviceRefused   6  the device refused or reported an error, is another one, or is commanded by someone else
    ├── CheckFailed     7  target not reached, read-back differs, past a limit, unhealthy, files differ
    ├── NotIdentified 3-6  not seen as one of this family before the first write: the code of what was met instead
    ├── NotConfirmed    8  --yes missing without a terminal, or the answer was no
    └── Interrupted   130  Ctrl-C

This module imports nothing. Foreign exceptions are translated where they arise, `from exc`.
"""

from __future__ import annotations


class Hint(str):
    """A next step: a sentence made with the commands that it names, and the first of them as data.

    ``Hint("free the finger, then run {}", "exo clear-errors")`` reads "free the finger, then run `handctl exo clear-errors`".
    `command` has the words after `handctl`. A command that needs a word from the reader, such as FILE, stays part of the text.
    """

    __slots__ = ("command",)
    command: str

    def __new__(cls, text: str, *commands: str) -> Hint:
        for command in commands:
            text = text.replace("{}", f"`handctl {command}`", 1)
        made = super().__new__(cls, text)
        made.command = commands[0] if commands else ""
        return made


def command_of(hint: str) -> str:
    """The command that a next step names, as the words after `handctl`; "" = none."""
    return hint.command if isinstance(hint, Hint) else ""


def reworded(hint: str, text: str) -> str:
    """Another text for the same next step."""
    if not command_of(hint):
        return text
    made = Hint(text)
    made.command = command_of(hint)
    return made


typed: set[str] = set()
"""Names that a user gave to things of this command, such as ``b`` for a device, a link or a file: no message may change them."""


def joined(*texts: str, joint: str = ". ") -> str:
    """Join texts, none that is said already. Sentences begin with a capital, except for a name as it is typed.

    The first command that one names stays.
    """
    first, *rest = [text for text in texts if text] or [""]
    named = next(filter(command_of, texts), "")
    for text in rest:
        behind = text[:1].upper() + text[1:] if joint == ". " and _is_word(text) else text
        if behind in first or text in first:
            continue
        first = f"{first} {behind}" if first.endswith(("?", "!")) else f"{first.rstrip(joint[0])}{joint}{behind}"
    return reworded(named, first)


def _is_word(text: str) -> bool:
    first = text.partition(" ")[0].rstrip(",:")
    return first != "handctl" and first not in typed and first.isascii() and first.replace("-", "").isalpha()


class Aftermath:
    """What a command leaves behind when it ends early: by Ctrl-C, a lost link, a deadline.

    text    shown after what happened
    hint    the next step for it, before the error's own; `joint` is put between the two
    behind  a hint that is shown after the error's own
    moving  the device may still be moving: a caller that can still stop it does, and replaces the text
    """

    def __init__(
        self, text: str = "", hint: str = "", *, behind: str = "", joint: str = ". ", moving: bool = False
    ) -> None:
        self.text = text
        self.hint = hint
        self.behind = behind
        self.joint = joint
        self.moving = moving


JUDGED = 4096
"""Bytes that came in place of an answer, as many as are looked at for what they are."""


class HandctlError(Exception):
    """Base of all errors that handctl raises on purpose.

    `text` says what happened, to which device, what was expected and what arrived; `hint` is the next step; both include
    what is `left` behind. `code` is a short stable word for scripts, e.g. ``bad-checksum``. `came` has the bytes that
    arrived instead of a reply, if known: they may belong to another device.
    """

    exit_code = 1
    default_code = "error"
    default_hint = ""
    rows: tuple[dict[str, object], ...] = ()
    """The rows that a library call had before it failed."""
    bounded = False
    """Whether the text already says that --deadline cut it short."""
    shown = False
    """True once it is in the output (the JSON envelope)."""
    unsent = False
    """Whether it is certain that what was to be sent did not go out: the link did not take the frame."""
    joint = ". "
    """Between what happened and what is left behind."""
    usual_text = ""

    def __init__(
        self, text: str = "", *, hint: str = "", code: str = "", left: Aftermath | None = None, came: bytes = b""
    ) -> None:
        self._text = text or self.usual_text
        super().__init__(self._text)
        self.came = came[:JUDGED]
        self.left = left or Aftermath()
        self._hint = hint or self.default_hint
        self.code = code or self.default_code

    def __str__(self) -> str:
        return self.text

    @property
    def text(self) -> str:
        """What happened, and what that leaves behind. A new text replaces both."""
        return joined(self._text, self.left.text, joint=self.joint)

    @text.setter
    def text(self, text: str) -> None:
        self._text = text
        left = self.left
        self.left = Aftermath("", left.hint, behind=left.behind, joint=left.joint, moving=left.moving)

    @property
    def hint(self) -> str:
        """The next step, first for what is left behind. A new hint replaces both."""
        return joined(self.left.hint, self._hint, self.left.behind, joint=self.left.joint)

    @hint.setter
    def hint(self, hint: str) -> None:
        self._hint = hint
        self.left = Aftermath(self.left.text, moving=self.left.moving)

    def add_aftermath(self, left: Aftermath) -> None:
        """Add what is left behind to the text and the hint so far."""
        self._text, self._hint, self.left = self.text, self.hint, left

    def reworded(self, text: str, *, hint: str | None = None, code: str = "") -> HandctlError:
        """The same error with another text: it keeps its exit code and the received bytes."""
        other = type(self).__new__(type(self), text)
        other.__dict__.update(self.__dict__, left=Aftermath(), code=code or self.code)
        other.text, other.hint = text, self.hint if hint is None else hint
        return other


class OutputError(HandctlError):
    """The output could not be written (full disk, lost file). Exit code 1, never about the device."""

    default_code = "output"
    default_hint = "check the free disk space and the permissions, or choose another file"


class UsageError(HandctlError):
    """The command line is invalid or incomplete, or a value is outside the documented range. Nothing was written. Exit code 2."""

    exit_code = 2
    default_code = "usage"


class LinkError(HandctlError):
    """The link cannot be opened, is busy, is not permitted, or was lost. Exit code 3."""

    exit_code = 3
    default_code = "link"


class NoAnswer(HandctlError):
    """The device did not reply in time. Exit code 4."""

    exit_code = 4
    default_code = "no-answer"


class ProtocolError(HandctlError):
    """Data arrived, but no valid reply: bad checksum, wrong id, echo, noise, wrong baud rate. Exit code 5."""

    exit_code = 5
    default_code = "bad-answer"


class DeviceRefused(HandctlError):
    """The device refused the request or reported an error, is not the device you named, or something else is commanding it.

    Exit code 6.
    """

    exit_code = 6
    default_code = "refused"


class NotPresent(DeviceRefused):
    """The device does not have what was asked for: another firmware, another model. It says so, or is silent to that alone."""

    @classmethod
    def shown_by(cls, met: HandctlError) -> NotPresent:
        """What was `met` shows it. Exit code and code stay those of that."""
        made = cls(met.text, hint=met.hint, code=met.code, came=met.came)
        made.exit_code = met.exit_code
        return made


class NotRunning(DeviceRefused):
    """The device is there, but nothing that could answer runs on it: it has no firmware, or has just been switched on."""

    default_code = "boot-monitor"


class CheckFailed(HandctlError):
    """A check failed: target not reached, read-back differs, past a --limit, unhealthy under --check, files differ. Exit code 7."""

    exit_code = 7
    default_code = "check-failed"


class NotIdentified(HandctlError):
    """Before the first write of a command: the device was not identified as one of this family. Nothing was written.

    It takes its exit code and code from the error `met`: 3 (the link), 4 (silence), 5 (no valid reply), 6 (another device).
    A separate class, because it must never be mistaken for a write that was not acknowledged.
    """

    default_code = "not-identified"

    def __init__(self, met: HandctlError) -> None:
        super().__init__(joined(met.text, "nothing was written"), hint=met.hint, code=met.code, came=met.came)
        self.exit_code, self.bounded = met.exit_code, met.bounded


class NotConfirmed(HandctlError):
    """The confirmation is missing or was denied. Nothing was written. Exit code 8."""

    exit_code = 8
    default_code = "not-confirmed"


OTHER_DEVICE = "other-device"
"""Code of the error where a device of another family has replied."""
STOPPED = "stopped"
"""Code of what another process, or the stop key, has stopped: no Ctrl-C."""


CTRL_C = "interrupted"


class Interrupted(HandctlError):
    """Ended by Ctrl-C, by `S` in a live view, or by a `handctl stop` from elsewhere, and either the device acknowledged the stop or nothing had been set in motion. Exit code 130."""

    exit_code = 130
    default_code = "interrupted"
    joint = ": "
    usual_text = CTRL_C


def says_nothing_new(error: HandctlError) -> bool:
    """Whether it is a Ctrl-C that left nothing behind: who pressed it knows."""
    return error.text == CTRL_C
