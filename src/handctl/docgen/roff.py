"""A man(7) page as text: titles, paragraphs, tagged items, literal lines; every character escaped once, here.

Clean under `mandoc -T lint` and `groff -man -ww`. Knows nothing of handctl. `plain` shows such a page where there is no man(1).
"""

from __future__ import annotations

import re
import textwrap

WIDTH = 78
SPECIAL = str.maketrans({"\\": r"\e", "-": r"\-", "'": r"\(aq", "`": r"\(ga", "^": r"\(ha", "~": r"\(ti"})


def escape(text: str) -> str:
    """Plain text as roff: hyphens stay hyphens (an option can be copied), other scripts become \\[uXXXX]."""
    coded = text.translate(SPECIAL)
    return coded if coded.isascii() else "".join(c if c.isascii() else f"\\[u{ord(c):04X}]" for c in coded)


def bold(text: str) -> str:
    """Words to be typed as they are."""
    return f"\\fB{escape(text)}\\fR"


def italic(text: str) -> str:
    """Words to be replaced."""
    return f"\\fI{escape(text)}\\fR"


def marked(text: str) -> str:
    """A text in which `this` is to be typed as it is, and **this** is not to be overlooked."""
    parts = re.split(r"(\*\*.+?\*\*|`[^`]+`)", text)
    return "".join(
        bold(re.sub(r"\*\*|`", "", part)) if position % 2 else escape(part) for position, part in enumerate(parts)
    )


class Page:
    """Collects the lines of one page. Texts for `para`, `item` and `tag` are roff already: see `marked`."""

    def __init__(self, name: str, date: str, source: str, manual: str, *, section: int = 1) -> None:
        self._lines = [f'.TH {escape(name.upper())} {section} {date} "{source}" "{manual}"', ".nh", ".ad l"]

    @property
    def text(self) -> str:
        return "\n".join(self._lines) + "\n"

    def section(self, title: str) -> None:
        """A heading at the margin."""
        self._lines.append(f".SH {title}")

    def subsection(self, title: str) -> None:
        """A heading within a section."""
        self._lines.append(f".SS {escape(title)}")

    def para(self, text: str) -> None:
        if not self._lines[-1].startswith((".SH", ".SS")):
            self._lines.append(".PP")
        self._fill(text)

    def item(self, tag: str, text: str) -> None:
        self._lines += [".TP", tag]
        self._fill(text)

    def bullet(self, text: str) -> None:
        """An entry of a list."""
        self._lines.append(r".IP \(bu 2")
        self._fill(text)

    def more(self, text: str) -> None:
        """A further paragraph of the last item."""
        self._lines.append(".IP")
        self._fill(text)

    def literal(self, lines: list[str], *, inside: bool = False) -> None:
        """Lines that keep their breaks, indented where they stand, or with `inside` below the last item; roff already."""
        if inside:
            self.indent()
        if not self._lines[-1].startswith((".SH", ".SS", ".IP", ".RS")):
            self._lines.append(".PP")
        self._lines += [".nf", *(_guard(line) for line in lines), ".fi"]
        if inside:
            self.outdent()

    def indent(self) -> None:
        """What follows belongs to the last item."""
        self._lines.append(".RS")

    def outdent(self) -> None:
        """The end of `indent`."""
        self._lines.append(".RE")

    def _fill(self, text: str) -> None:
        for sentence in re.split(r"(?<=[.?!:]) +(?=[A-Z\\])", " ".join(text.split())):
            lines = textwrap.wrap(sentence, WIDTH, break_long_words=False, break_on_hyphens=False)
            self._lines += [_guard(line) for line in lines]


def _guard(line: str) -> str:
    """A line that begins with a dot is not a request."""
    return f"\\&{line}" if line.startswith((".", "'")) else line


# -- as plain text -----------------------------------------------------------------------------------------------------

INDENT = 4
MARKS = {
    r"\-": "-",
    r"\(aq": "'",
    r"\(ga": "`",
    r"\(ha": "^",
    r"\(ti": "~",
    r"\(bu": "*",
    r"\e": "\\",
    r"\&": "",
    r"\%": "",
}
CODED = re.compile(r"\\\[u([0-9A-F]+)\]|\\f[BIR]|\\\((?:aq|ga|ha|ti|bu)|\\[-e&%]")


def plain(page: str, width: int = 78) -> str:
    """What `Page` wrote as lines of at most `width` columns; literal lines keep theirs."""
    out: list[str] = []
    words: list[str] = []
    tag, literal, expects_tag, depth, hang = "", False, False, INDENT, 0

    def flush() -> None:
        nonlocal tag
        if words or tag:
            at = " " * (depth + hang)
            lines = textwrap.wrap(" ".join(words), max(width, 40), initial_indent=at, subsequent_indent=at, break_on_hyphens=False, break_long_words=False)  # fmt: skip
            if tag:
                first = " " * depth + tag
                if lines and len(first) < depth + hang:
                    lines[0] = first.ljust(depth + hang) + lines[0].strip()
                else:
                    lines.insert(0, first)
            out.extend(lines)
        words.clear()
        tag = ""

    for line in page.splitlines():
        macro, _, rest = line.partition(" ")
        if expects_tag:
            tag, expects_tag = _shown(line), False
        elif not line.startswith("."):
            if literal:
                out.append(" " * (depth + hang) + _shown(line))
            else:
                words.append(_shown(line))
        elif macro in (".TH", ".nh", ".ad"):
            continue
        else:
            flush()
            if macro in (".SH", ".SS"):
                depth, hang = INDENT, 0
                out += ["", _shown(rest) if macro == ".SH" else f"  {_shown(rest)}"]
            elif macro == ".PP":
                hang = 0
                out.append("")
            elif macro == ".TP":
                hang, expects_tag = INDENT, True
                out.append("")
            elif macro == ".IP":
                hang = 2 if rest else INDENT
                tag = _shown(rest.partition(" ")[0])
                out += [] if rest else [""]
            elif macro in (".RS", ".RE"):
                depth, hang = depth + (INDENT if macro == ".RS" else -INDENT), 0
            literal = macro == ".nf"
    flush()
    return "\n".join(out).strip("\n") + "\n"


def _shown(text: str) -> str:
    return CODED.sub(lambda found: chr(int(found[1], 16)) if found[1] else MARKS.get(found[0], ""), text)
