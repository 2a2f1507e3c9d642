"""Rows of a result that may be longer than memory: kept on the disk as lines of JSON until the envelope around them is known."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator

from handctl.errors import OutputError
from handctl.model.result import Row
from handctl.screen.render import dumps


class Spool:
    """Takes rows one by one, gives back their JSON in order. Raises OutputError where the disk has no room."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile("w+", encoding="utf-8", errors="surrogatepass", newline="\n")  # noqa: SIM115 - until the last line was read

    def take(self, rows: Iterable[Row]) -> None:
        """Append them; what came before an error stays."""
        try:
            for row in rows:
                self._file.write(dumps(row) + "\n")
        except OSError as exc:
            raise OutputError(
                f"{tempfile.gettempdir()}: cannot be written: {exc.strerror or exc}",
                hint="make room there, or choose --format ndjson, which needs none",
            ) from exc

    def lines(self) -> Iterator[str]:
        """The JSON of each row."""
        with self._file as file:
            file.seek(0)
            yield from (line.rstrip("\n") for line in file)
