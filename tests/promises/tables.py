"""The tables of the matrix by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from tests.promises import documents, library, lines, options, sentences, symptoms, verbs
from tests.promises.cells import Cell

TABLES: dict[str, Callable[[], Iterator[Cell]]] = {
    "symptoms": symptoms.cells,
    "verbs": verbs.cells,
    "options": options.cells,
    "sentences": sentences.cells,
    "library": library.cells,
    "lines": lines.cells,
    "documents": documents.cells,
}
