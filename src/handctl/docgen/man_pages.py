"""The man pages: handctl(1), one for each top-level command, as git has it, and one of section 7 for each guide.

Everything but the prose at the beginning comes from the command tree, the parameter maps, the error tree and the options.

A page is looked up by its top-level command, "" is handctl(1). A family has its own files and examples in its module
`manpage`: FILES as here, EXAMPLES as in `command.help_text`, and `section() -> title, paragraphs, (term, text, lines) items` where
it has more to say; EXCEPTIONS are rows of (key of a promise, commands or options that it does not cover, what they do instead and why), see `guide_tables`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from handctl import __version__, errors, guides
from handctl.command.family import page_of
from handctl.command.help_text import examples_of
from handctl.docgen.completion_scripts import mnemonic
from handctl.docgen.read_command_tree import Node, Option
from handctl.docgen.roff import Page, bold, escape, italic, marked
from handctl.families import FAMILIES
from handctl.guides import Code, Heading, Item, Para, Table
from handctl.model.device_picture import UNKNOWN, remedies_of
from handctl.model.param import MEASURED, Param
from handctl.wording import sentence

REFERENCE = re.compile(r"\b(handctl(?:-[a-z]+)*)\(([17])\)")
EDITION = "2026-11-21"
"""Date of the pages: of their wording, not of the day they are generated."""

LINKS = (
    ("/dev/ttyUSB0, COM3", "A serial port, opened exclusively. pyserial URLs work too."),
    ("usb:VID:PID[:SERIAL]", "The serial port of exactly that USB device."),
    ("tcp://HOST:PORT", "A TCP connection."),
    (
        "can:INTERFACE:CHANNEL[?bitrate=N]",
        "Any python-can interface, such as `can:socketcan:can0` or `can:slcan:/dev/ttyACM0`.",
    ),
    (
        "fake://DEVICE[?KEY=VALUE&...]",
        "A simulator inside the handctl command itself, which starts afresh with each command. The keys are listed in handctl-sim(1). Plain `--fake` "
        "keeps the device's state until you log out.",
    ),
    ("replay:FILE", "A transcript recorded with `--trace`, replayed in place of the device."),
)

OUTPUT = (
    "Data goes to standard output, everything else to standard error. On a terminal the result is a table with lines; on a "
    "pipe the same columns are aligned with spaces. `--format plain` prints bare values separated by tabs, one row per line.",
    "`--json` prints one object, even if the command fails: the rows, the messages, the exit code and the counters of "
    "the line. A stream prints one row per line, then a last line with the object, without rows, under the key `end`. "
    "JSON is always UTF-8 and contains every character unchanged. A byte that is not UTF-8 is escaped, such as `\\xff`.",
    "In all other formats, control characters, bidi marks and bytes that are not UTF-8 are escaped, such as `\\x1b` for "
    "Escape, so a device cannot control your terminal. If standard output or standard error cannot show a character, handctl "
    "replaces it: `deg C`, `...`, `sec.`, `#` for a bar, otherwise its number. In CSV, `--no-formulas` puts ' before any "
    "text that begins with = + - or @ and is not a number.",
)

SAFETY = (
    "Many commands start a movement immediately, without asking. Others ask first, and without a terminal they need `--yes`: the "
    "table in handctl-safety(7) lists both. `--dry-run` prints the exact bytes and sends nothing. Values outside the "
    "documented range are refused, never clamped. Writes are read back and never retried. Ctrl-C stops a movement as far as "
    "the device's protocol allows.",
    "While a command drives a device, a second process keeps the link open. If handctl is killed, that process stops the "
    "device as `stop` does. It cannot help if everything dies at once: the container, the service, the computer, its "
    "power. For CAN adapters that use a vendor's library there is no second process, and handctl warns you. "
    "A command that is only suspended is still alive: run `stop`.",
)

FILES: dict[str, tuple[tuple[str, str], ...]] = {
    "devices": (
        (
            "$XDG_CONFIG_HOME/handctl/config.toml",
            "Options by their long names, with _ for -, and the named devices; by default in ~/.config, on Windows in %APPDATA%.",
        ),
    ),
    "shell": (("$XDG_STATE_HOME/handctl/shell-history", "The history of the prompt; by default in ~/.local/state."),),
    "sim": (
        (
            "$XDG_RUNTIME_DIR/handctl/sim-FAMILY.json",
            "The state of a device simulated with plain --fake; without that variable in /run/user or the temporary folder.",
        ),
    ),
    "completion": (
        ("$XDG_DATA_HOME/bash-completion/completions/handctl", "Installed for bash; by default in ~/.local/share."),
        ("$XDG_DATA_HOME/zsh/site-functions/_handctl", "Installed for zsh; by default in ~/.local/share."),
        ("$XDG_CONFIG_HOME/fish/completions/handctl.fish", "Installed for fish; by default in ~/.config."),
        ("%LOCALAPPDATA%\\handctl\\handctl.ps1", "Installed for PowerShell on Windows."),
    ),
}


def pages(tree: Node) -> dict[str, str]:
    """File name -> page."""
    return {"handctl.1": one(tree)} | {f"handctl-{node.path[0]}.1": one(tree, node.path[0]) for node in tree.children}


def one(tree: Node, command: str = "") -> str:
    """The page of a top-level command, or of handctl as a whole."""
    return next((_command(node, tree) for node in tree.children if node.path[0] == command), "") or _root(tree)


def _page(name: str, summary: str, section: int = 1) -> Page:
    page = Page(name, EDITION, f"handctl {__version__}", "handctl manual", section=section)
    page.section("NAME")
    page.para(f"{escape(name)} \\- {escape(summary)}")
    return page


def _root(tree: Node) -> str:
    page = _page("handctl", tree.help.rstrip("."))
    page.section("SYNOPSIS")
    page.literal([f"{bold('handctl')} [{italic('OPTIONS')}] {italic('COMMAND')} ..."])
    page.section("DESCRIPTION")
    page.para(escape(tree.help))
    page.para(
        "Options can go anywhere: before the command, after it or after its subcommand. The one closest to the subcommand wins. "
        "Side by side, the last one wins, but two different -p, -d or --id are an error, and so are two different values for an option "
        "of a command that writes. "
        "Each has an environment variable, and a key in the configuration file. The command line goes before the "
        "environment, then comes what a named device says, then the file."
    )
    for text in SAFETY:
        page.para(marked(text))
    page.section("COMMANDS")
    for node in tree.children:
        page.item(_reference(f"handctl-{node.path[0]}"), _sentence(node.summary))
    page.section("GUIDES")
    for name, summary in map(guides.title, map(guides.source, guides.names())):
        page.item(_reference(name, 7), _sentence(summary))
    page.section("OPTIONS")
    _options(page, tree.options)
    page.section("LINKS")
    for link, text in LINKS:
        page.item(bold(link), marked(text))
    page.section("OUTPUT")
    for text in OUTPUT:
        page.para(marked(text))
    return _closing(page, tree, tree)


def _command(node: Node, tree: Node) -> str:
    name = f"handctl-{node.path[0]}"
    page = _page(name, node.summary)
    leaves = [leaf for leaf in node.walk() if not leaf.children]
    page.section("SYNOPSIS")
    page.literal([_usage(leaf) for leaf in leaves])
    page.section("DESCRIPTION")
    _paragraphs(page, node.help, inside=False)
    shared = tree.shared
    if node.children:
        page.section("COMMANDS")
        for leaf in leaves:
            first, _, rest = leaf.help.partition("\n\n")
            page.item(_usage(leaf, len(node.path)), marked(first))
            _paragraphs(page, rest, inside=True)
            if leaf.writes and "-n, --dry-run" not in leaf.help:
                shows = "the bytes and sends" if node.path[0] in FAMILIES else "what would change and writes"
                page.more(f"It writes: {bold('-n')} shows {shows} nothing.")
            _below(page, leaf, (*shared, *node.options))
    page.section("OPTIONS")
    _options(page, node.options)
    if node.params:
        page.section("QUANTITIES")
        for param in node.params:
            short = mnemonic(param)
            page.item(bold(param.name) + (f", {bold(short)}" if short else ""), _about(param))
    _section(page, node.path[0])
    _remedies(page, node.path[0])
    return _closing(page, node, tree)


def _own(family: str, name: str) -> Any:
    """What a family's module `page` says, None without it."""
    return getattr(page_of(family), name, None) if family in FAMILIES else None


def _remedies(page: Page, family: str) -> None:
    """What the findings of a family mean, and what to do."""
    table = remedies_of(family) if family in FAMILIES else {}
    if table:
        page.section("FINDINGS")
    for name, remedy in table.items():
        page.item(
            bold(name.replace("_", " ") if name == UNKNOWN else name),
            marked(f"{sentence(remedy.meaning)} {sentence(remedy.hint)}"),
        )


def _section(page: Page, family: str) -> None:
    """A family's own sections, in addition to its commands."""
    section = _own(family, "section")
    if section is None:
        return
    title, paragraphs, items = section()
    page.section(title)
    for text in paragraphs:
        page.para(marked(text))
    for term, text, lines in items:
        page.item(bold(term), marked(text))
        if lines:
            page.literal([escape(line) for line in lines], inside=True)


def _usage(node: Node, skip: int = 0) -> str:
    """The line of a command; `skip` words of its path are left out, and so is the program."""
    words = [bold(" ".join(("handctl", *node.path)) if not skip else " ".join(node.path[skip:]))]
    if not skip:
        words.append(f"[{italic('OPTIONS')}]")
    return " ".join([*words, *(italic(argument.metavar) for argument in node.arguments)])


def _paragraphs(page: Page, text: str, *, inside: bool) -> None:
    """A click help text; a paragraph that begins with \\b keeps its lines. The first one of an item stands there."""
    for paragraph in filter(None, re.split(r"\n\s*\n", text)):
        if paragraph.startswith("\b"):
            lines = [marked(line) for line in paragraph.lstrip("\b\n").splitlines()]
            page.literal(lines, inside=inside)
        else:
            (page.more if inside else page.para)(marked(" ".join(paragraph.split())))


def _below(page: Page, leaf: Node, known: Sequence[Option]) -> None:
    """A command's own options and lists, indented below it."""
    own = [option for option in leaf.options if option not in known and "--help" not in option.names]
    if not own and not leaf.sections:
        return
    page.indent()
    for option in own:
        page.item(_tag(option), marked(option.help))
    for section in leaf.sections:
        page.para(bold(section.title))
        for word, text in section.rows:
            page.item(bold(word), _sentence(text))
    page.outdent()


def _options(page: Page, options: Iterable[Option]) -> None:
    groups: dict[str, list[Option]] = {}
    for option in options:
        groups.setdefault(option.section, []).append(option)
    for title in ("Options", *(name for name in groups if name != "Options")):
        if title in groups and len(groups) > 1:
            page.subsection("General" if title == "Options" else title)
        for option in groups.get(title, ()):
            page.item(_tag(option), marked(option.help))


def _tag(option: Option) -> str:
    names = ", ".join(bold(name) for name in option.names)
    return f"{names} {italic(option.metavar)}" if option.metavar else names


def _about(param: Param) -> str:
    access = {"r": "read only", "rw": "read and write", "w": "write only"}.get(param.access, param.access)
    facts = [access if param.kind == MEASURED else "trigger" if param.trigger else f"{param.kind}, {access}"]
    if param.range_text:
        facts.append(param.range_text + (f" {param.unit}" if param.unit else ""))
    elif param.unit:
        facts.append(f"in {param.unit}")
    parts = [_sentence(param.doc + (f"; {param.note}" if param.note else "")), _sentence("; ".join(facts))]
    if param.elements:
        parts.append(f"Elements: {', '.join(map(italic, param.elements))}.")
    if param.bits:
        parts.append(f"Bits from 0: {escape(', '.join(param.bits))}.")
    return " ".join([*parts, f"Source: {escape(param.source)}."])


def _closing(page: Page, node: Node, tree: Node) -> str:
    name = node.path[0] if node.path else ""
    page.section("EXIT STATUS")
    for code, text in exit_codes():
        page.item(bold(str(code)), _sentence(text))
    if node.shared:
        page.section("ENVIRONMENT")
        for variable, text in _environment(node):
            page.item(bold(variable), text)

    def files_of(command: str) -> Sequence[tuple[str, str]]:
        return _own(command, "FILES") or FILES.get(command, ())

    files = [*files_of(name), *(FILES["devices"] if name in FAMILIES else ())]
    if not name:
        files = [entry for child in tree.children for entry in files_of(child.path[0]) if "/" in entry[0]]
    if files:
        page.section("FILES")
        for path, text in files:
            page.item(italic(path), marked(text))
    page.section("EXAMPLES")
    for line, text in examples(node):
        page.item(bold(line), marked(text))
    page.section("SEE ALSO")
    page.para(_see_also([child.path[0] for child in tree.children], name, "-".join(("handctl", *node.path))))
    return page.text


def _see_also(commands: Iterable[str], about: str, page: str) -> str:
    """The pages beside `page`, which is `about` a command or guide. handctl(1) names all; the others no page of another family."""

    def near(name: str) -> bool:
        return not about or name == about or name not in FAMILIES

    pages = [("handctl", 1), *((f"handctl-{name}", 1) for name in commands if near(name))]
    pages += [(guides.title(guides.source(name))[0], 7) for name in guides.names() if near(name)]
    return ",\n".join(_reference(*one) for one in pages if one[0] != page)


def exit_codes() -> list[tuple[int, str]]:
    """Exit code -> meaning, from the error tree."""
    found = {0: "Done.", 1: "A bug in handctl, or the output could not be written."}
    for kind in vars(errors).values():
        if isinstance(kind, type) and issubclass(kind, errors.HandctlError) and kind.exit_code not in found:
            text = " ".join((kind.__doc__ or "").split())
            found[kind.exit_code] = re.sub(rf" ?Exit code {kind.exit_code}\b[^.]*\.", "", text)
    return sorted(found.items())


def _environment(node: Node) -> Iterable[tuple[str, str]]:
    for option in node.options:
        if option.env:
            long = option.names[-1]
            same = f"The same as {bold(long)} {italic(option.metavar)}."
            yield option.env, f"1 is the same as {bold(long)}." if option.value is None else same
    yield "HANDCTL_CONFIG", f"Another configuration file than the one that {bold('handctl devices')} keeps."
    yield "NO_COLOR", f"Anything but an empty value: no colour, unless {bold('--color always')} is given."


def examples(node: Node) -> list[tuple[str, str]]:
    """Command line -> what it shows, of each command of a page in the order of its commands."""
    leaves = [node] if not node.path else [leaf for leaf in node.walk() if not leaf.children]
    return [one for leaf in leaves for one in examples_of(leaf.path)]


def _reference(page: str, section: int = 1) -> str:
    return f"\\%{bold(page)}({section})"


def _sentence(text: str) -> str:
    text = text.strip()
    text = text[:1].upper() + text[1:]
    return marked(text if text.endswith((".", "?", "!")) else f"{text}.")


# -- guides -------------------------------------------------------------------------------------------------------------


def guide(text: str) -> str:
    """One guide as a page of section 7."""
    name, summary = guides.title(text)
    made = _page(name, summary, 7)
    for number, block in enumerate(guides.blocks(text)):
        if not number and not isinstance(block, Heading):
            made.section("DESCRIPTION")
        if isinstance(block, Heading) and block.level == 2:
            made.section(escape(block.text.upper()))
        elif isinstance(block, Heading):
            made.subsection(block.text)
        elif isinstance(block, Para):
            made.para(words(block.text))
        elif isinstance(block, Item):
            made.bullet(words(block.text))
        elif isinstance(block, Code):
            made.literal([f"    {escape(line)}".rstrip() or "\\&" for line in block.lines])
        else:
            _table(made, block)
    made.section("SEE ALSO")
    about = name.removeprefix("handctl-").removesuffix("-guide")
    made.para(_see_also([about] if about in FAMILIES else [], about, name))
    return made.text


def words(text: str) -> str:
    """Marked text in which the names of pages are bold."""
    made, place = "", 0
    for found in REFERENCE.finditer(text):
        made += marked(text[place : found.start()]) + _reference(found[1], int(found[2]))
        place = found.end()
    return made + marked(text[place:])


def _table(made: Page, table: Table) -> None:
    """The first cell is the tag; of further columns each says its heading."""
    heading, *rows = table.rows
    for first, *rest in rows:
        if len(rest) == 1:
            text = rest[0]
        else:
            text = " ".join(_said(name, cell) for name, cell in zip(heading[1:], rest, strict=True) if cell)
        made.item(words(first) if "`" in first else bold(first), words(text))


def _said(name: str, cell: str) -> str:
    return f"{name[:1].upper()}{name[1:]}: {cell if cell.endswith('.') else cell + '.'}"
