"""A table of cases in one test: every row runs, with a state, a folder and patches of its own, and each that fails is named."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest

from tests.support import own_state

FIRST = "HANDCTL_TESTS_FIRST"
"""A variable of the environment: one row that fails is enough."""


def each_row(
    names: str | Sequence[str], table: Iterable[Any] | Callable[[], Iterable[Any]], ids: Any = None
) -> Callable[[Any], Any]:
    """Like `pytest.mark.parametrize`, but one test: for tables of more than a dozen rows.

    A table that takes time to make is a function, and made when the test runs: collecting waits for none.
    `tmp_path` is a folder for each row, `monkeypatch` is undone behind each. Other fixtures are the same for all rows.
    """
    keys = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)

    def made() -> list[tuple[str, dict[str, Any]]]:
        return [_case(keys, row, number, ids) for number, row in enumerate(table() if callable(table) else table)]

    ready = None if callable(table) else made()

    def decorate(test: Any) -> Any:
        signature = inspect.signature(test)

        @functools.wraps(test)
        def looped(**fixtures: Any) -> None:
            failed: list[tuple[str, BaseException]] = []
            cases = made() if ready is None else ready
            for number, (label, values) in enumerate(cases):
                try:
                    _one(test, number, {**fixtures, **values})
                except (Exception, pytest.fail.Exception) as exc:  # noqa: BLE001 - each row is tried, whatever the others did
                    failed.append((label, exc))
                    if FIRST in os.environ:
                        break
            if failed:
                told = "\n".join(f"[{label}] {type(exc).__name__}: {_first(exc)}" for label, exc in failed)
                raise AssertionError(f"{len(failed)} of {len(cases)} rows failed\n{told}") from failed[0][1]

        left = [parameter for name, parameter in signature.parameters.items() if name not in keys]
        looped.__signature__ = signature.replace(parameters=left)  # type: ignore[attr-defined]
        del looped.__wrapped__
        return looped

    return decorate


def _one(test: Any, number: int, given: dict[str, Any]) -> None:
    """One row: with what belongs to a test alone made for it."""
    own_state.begin()
    if "tmp_path" in given:
        given["tmp_path"] = given["tmp_path"] / f"row{number}"
        given["tmp_path"].mkdir()
    if "capsys" in given:
        given["capsys"].readouterr()
    if "monkeypatch" not in given:
        test(**given)
        return
    with pytest.MonkeyPatch.context() as patch:
        test(**{**given, "monkeypatch": patch})


def _case(keys: list[str], row: Any, number: int, ids: Any) -> tuple[str, dict[str, Any]]:
    name = getattr(row, "id", None) if isinstance(row, type(pytest.param())) else None
    values = row.values if isinstance(row, type(pytest.param())) else (row,) if len(keys) == 1 else tuple(row)
    assert len(values) == len(keys), f"row {number} has {len(values)} values for {keys}"
    if name is None and ids is not None:
        name = "-".join(str(ids(value)) for value in values) if callable(ids) else list(ids)[number]
    return str(name or ", ".join(map(_told, values)))[:200], dict(zip(keys, values, strict=True))


def _told(value: Any) -> str:
    try:
        return repr(value)
    except ValueError:  # an integer of more digits than Python prints
        return type(value).__name__


def _first(exc: BaseException) -> str:
    return str(exc).strip()[:2000]
