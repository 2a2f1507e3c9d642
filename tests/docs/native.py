"""Count wording that sounds translated, per 1,000 words: `python -m tests.docs.native [--show PAGE]`. No test, a look.

README, each guide, helps and messages are compared with the manuals of native programs that are on this computer.
"""

from __future__ import annotations

import gzip
import re
import sys
from collections import Counter
from pathlib import Path

from handctl.docgen.read_command_tree import read_tree
from tests.docs.words import ROOMS, spoken, texts
from tests.support.places import TEXTS

MANUALS = """git git-commit git-rebase ssh scp curl tmux rsync tar find grep sed awk mawk less screen minicom picocom stty
socat smartctl hdparm ip tcpdump nmap wget gpg openssl vim make gcc gdb strace systemctl journalctl bash zsh ssh-keygen
dd df du ls cp mv ps top kill mount lsusb udevadm date sort xargs"""
PATTERNS = r"""
upon|afresh|whoever|thereof|hereby|wherein|whereby|anew|henceforth|wherever|whatever (?:is|has|was)
stands? (?:for|in|at|on|beside|below|above|behind|there|first|still)|stood|tells?\b|told\b|is (?:let go|had)\b|stays out
a wish|wishes|beside|besides|behind (?:it|them|the|a|its|this)|(?:leave|leaves|left) (?:out|aside)|is left out
of its own|of their own|of one's own|again and again|all the same|by itself|by themselves|in place of|one after the other
^so that|^where|^what|^who|^of (?:the|a|it|them|these|those)|^without (?:it|them|these)|^else\b|^behind
what (?:is|was|are|it|they|came|has|had|can|a|the|handctl|moves|stays|follows|comes|answers|holds)\b
where (?:it|that|this|there|they|no|nothing|one|none|the|a|handctl)\b|who (?:is|has|holds|asks|answers|speaks|may|can)\b
which (?:there|of them|it) (?:is|are|was|has)|(?:is|are|was|were) (?:there|none|such)\b|as far as|so much as
may (?:stand|be left|be given|not be)|need(?:s)? not|is to be|are to be|shall\b
no (?:byte|frame|answer|data|valid|other|whole) (?:came|that|in it|comes)|(?:came|comes) (?:that|as|from|in|with)
came back|went out|goes out|for good|not yet known|is not known|are not known|known (?:from|to be)|nobody|somebody
looks? (?:which|who|what|at which|whether|there)|(?:speaks?|spoken)\b|asks? no|says? (?:so|what|which|where|that)
holds? (?:what|no|the same|every|it|for)|keeps? what|(?:does|do) (?:without|so|that)\b|serves? there|counts? as|as it (?:is|was|came|stands)
""".replace("\n", "|").strip("|")  # fmt: skip
TRANSLATED = re.compile(rf"(?<![\w-])(?:{PATTERNS})(?![\w-])", re.IGNORECASE)
"""Words of the voice's sixth rule, bare clauses as nouns, inversions, and verbs that no native manual uses so often."""


def rate(text: list[str]) -> tuple[int, Counter[str]]:
    """Words, and what was found in them. A text is taken apart into sentences, for `^`."""
    words, found = 0, Counter[str]()
    for sentence in (
        one for piece in text for one in re.split(r"(?<=[.!?:;])\s+|\n\n", re.sub(r"`[^`]*`", "X", piece))
    ):
        words += len(sentence.split())
        found.update(hit[0].casefold() for hit in TRANSLATED.finditer(sentence.strip()))
    return words, found


def manuals() -> list[tuple[str, list[str]]]:
    """The manuals that are here, their running text."""
    files = [path for name in MANUALS.split() for path in Path("/usr/share/man").glob(f"man[18]/{name}.[18]*")]
    bare = r"^\.(?:\\\"|TH|SH|SS|de|if|ie|el|nr|ds|nf|in|ti|sp|so).*$|^\.\w+ ?|\\f[A-Z]|\\f\(..|\\&|\\[|/^]|\"|^'.*$"
    raw = [(path.stem, path.read_bytes()) for path in files]
    read = [
        (name, (gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data).decode("utf-8", "replace"))
        for name, data in raw
    ]
    pages = [(name, re.sub(bare, "", text, flags=re.M).replace("\\-", "-").replace("\n", " ")) for name, text in read]
    return [(name, [text]) for name, text in pages if len(text.split()) > 300]


def ours() -> list[tuple[str, list[str]]]:
    """README, each guide, the helps of all commands, and the texts in the code."""
    nodes = [node for top in read_tree().children for node in top.walk()]
    helps = [text for node in nodes for text in (node.help, *(option.help for option in node.options)) if text]
    pages = [(name, list(spoken(path.read_text(encoding="utf-8")))) for name, path in TEXTS.items()]
    said = [text for room in ROOMS if room != "sim" for _place, text in texts(room)]
    return [*pages, ("helps", list(dict.fromkeys(helps))), ("messages", list(dict.fromkeys(said)))]


def main() -> None:
    """Print the table, and with --show PAGE the words found in that page."""
    native = [rate(text) for _name, text in manuals()]
    words, hits = sum(count for count, _ in native), sum(found.total() for _, found in native)
    worst = max((1000 * found.total() / count for count, found in native), default=0.0)
    rows = [(f"{len(native)} native manuals", words, hits), *((name, *rate(text)) for name, text in ours())]
    for name, count, found in rows:
        total = found if isinstance(found, int) else found.total()
        print(f"{name:22} {count:8} words {total:5} found {1000 * total / max(1, count):6.1f} per 1,000")
        if not isinstance(found, int) and name == sys.argv[-1]:
            print("    " + ", ".join(f"{hit} {number}" for hit, number in found.most_common(40)))
    print(f"{'worst native manual':22} {worst:29.1f} per 1,000")


if __name__ == "__main__":
    main()
