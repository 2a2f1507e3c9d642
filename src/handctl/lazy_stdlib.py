"""Modules of the standard library that click and dataclasses import and a command hardly ever uses: stood in for until they are.

They are a tenth of the start. Only the program does this (`cli.main`), never the library: the process is its own. Knows no click.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

own_process = False
"""Whether the process is the program's own: nobody else in it asks for a module."""


def defer_unused_modules() -> None:
    """Stand in for those that are not loaded yet."""
    global own_process  # noqa: PLW0603 - there is one process
    own_process = True
    _late("inspect", cleandoc=_cleandoc, isclass=lambda found: isinstance(found, type))
    _late("uuid", UUID=None)
    _late("pickle", "dumps", "loads")  # of rich's styles with a memory, of which we have none
    _late("random", "randint")
    _late("ast", "literal_eval")
    _late("fractions", "Fraction")
    _late("gettext", gettext=str, ngettext=_either)  # what click says is in English, as all that handctl says


def _late(name: str, *called: str, **known: Any) -> None:
    """A module that has what is `known`, and becomes the real one once anything else is asked of it, or a function is `called`."""
    if name in sys.modules:
        return
    module = ModuleType(name)

    def load(attribute: str) -> Any:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        if sys.modules.get(name) is module:
            del sys.modules[name]
        real = import_module(name)
        vars(module).update(vars(real))
        return getattr(real, attribute)

    def forward(attribute: str) -> Any:
        def call(*args: Any, **more: Any) -> Any:
            return load(attribute)(*args, **more)

        return call

    vars(module).update(known, __getattr__=load, **{attribute: forward(attribute) for attribute in called})
    sys.modules[name] = module


def _either(one: str, several: str, count: int) -> str:
    return one if count == 1 else several


def _cleandoc(text: str) -> str:
    """As `inspect` has it."""
    lines = text.expandtabs().split("\n")
    margin = min((len(line) - len(line.lstrip(" ")) for line in lines[1:] if line.strip(" ")), default=0)
    lines = [lines[0].lstrip(" "), *(line[margin:] for line in lines[1:])]
    return "\n".join(lines).strip("\n")
