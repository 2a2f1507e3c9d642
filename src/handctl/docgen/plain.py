"""A page of `roff` as plain text, for `handctl help` where there is no man(1). Reads what `roff.Page` writes, no more."""

from __future__ import annotations

import re
import textwrap

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
    """The page as lines of at most `width` columns; literal lines keep theirs."""
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
