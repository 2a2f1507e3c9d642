"""OpenMetrics: rows -> what a monitoring system reads, with base units, help and labels. Knows no sink and no terminal.

Everything is a gauge without a moment of its own, so that the older text format of Prometheus, which the textfile
collector of its node exporter takes, is the same text. A doubtful value is left out, and so is what tells one person or
one device from another. What a device calls an error is a gauge a bit: 1 where it is set.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from handctl.errors import HandctlError, UsageError
from handctl.model.param import BASES, scale_of
from handctl.model.result import PARTS, Row, Sample
from handctl.screen.sanitize import shown

if TYPE_CHECKING:
    from handctl.screen.render import Context, Sink

VERBS = ("status", "dump", "watch")
"""The commands that show what a device is like now."""


class Metric(NamedTuple):
    """A family of samples: what is said of it once, and each value with its labels."""

    unit: str
    help: str
    samples: dict[tuple[tuple[str, str], ...], str]


def exposition(rows: Sequence[Row], context: Context, failure: HandctlError | None = None) -> str:
    """The metrics of one reading: its values, `up` and `unread`. Valid output for any rows."""
    device = context.envelope(failure)["device"] or {}
    kind = _word(str(device.get("kind") or context.command.split(" ", maxsplit=1)[0]))
    common = {"device": context.settings.device or device.get("link") or "", "id": device.get("id")}
    metrics: dict[str, Metric] = {}

    def add(name: str, unit: str, text: str, labels: dict[str, Any], value: Any) -> None:
        metric = metrics.setdefault(f"handctl_{kind}_{name}", Metric(unit, text, {}))
        said = tuple((key, str(label)) for key, label in (common | labels).items() if label not in (None, ""))
        metric.samples.setdefault(said, _number(value))

    for row in rows:
        _add_row(row, getattr(getattr(context, "opened", None), "map", None), add)
    unread = sum("error" in row for row in rows)
    add("up", "", "1 if the device reported a value, otherwise 0", {}, len(rows) > unread)
    add("unread", "", "values that could not be read", {}, unread)
    if context.command.endswith(" status"):
        findings = [message for message in context.journal.messages if message.code == "unhealthy"]
        add("findings", "", "findings of status: 0 if the device is healthy", {}, len(findings))
    return "".join(_lines(name, metric) for name, metric in metrics.items()) + "# EOF\n"


def stream(samples: Generator[Sample, None, None], sink: Sink, context: Context) -> None:
    """Each sample as a whole: a file is replaced with it; on a pipe it follows the one before."""
    for sample in samples:
        sink.write_whole(exposition(sample.rows, context))
        if sink.broken:
            return


def refuse(command: str) -> None:
    """Raise UsageError for a command that shows no values of now."""
    if command.rpartition(" ")[2] not in VERBS:
        raise UsageError(
            f"--format openmetrics is for {', '.join(VERBS[:-1])} and {VERBS[-1]}",
            hint="use --json. Nothing was sent.",
            code="format",
        )


def _add_row(row: Row, params: Any, add: Any) -> None:
    param = _param(params, row.get("path"))
    value, errors = row.get("value"), row.get("errors")
    if row.get("doubt") or (param is not None and param.private):
        return
    labels = {key: row[key] for key in PARTS if row.get(key)}
    if param is not None and param.elements and not labels:
        labels["element"] = str(row["path"]).removeprefix(f"{param.path}.")
    name = str(param.path if param is not None else row.get("name") or "value")
    text = param.doc if param is not None else "calculated by handctl"
    if errors is not None and param is not None:
        known = [*param.alarms.values(), *(error for error in errors if error not in param.alarms.values())]
        for bit in known:
            add(_word(name), "", f"{text}: 1 if the bit is set", {**labels, "bit": bit}, bit in errors)
        return
    if isinstance(value, str):
        add(_word(name), "", f"{text}: a text, in the label", {**labels, "text": value}, 1)
    elif isinstance(value, bool):
        add(_word(name), "", text, labels, value)
    elif isinstance(value, int | float):
        said = row.get("unit") or ""
        scale = scale_of(said)
        base = BASES.get(scale.unit if scale is not None else said)
        name = _word(name).removesuffix(f"_{said}")
        if base is None:
            add(name, "", text, labels, value)
        else:
            name = f"{name.removesuffix(f'_{base.unit}')}_{base.unit}"
            add(name, base.unit, text, labels, base.of(scale.of(value) if scale is not None else value))


def _param(params: Any, path: str | None) -> Any:
    """The quantity of a row in the map of its device; None for what handctl works out."""
    if params is None or path is None:
        return None
    try:
        return params.find(path)[0]
    except UsageError:
        return None


def _word(text: str) -> str:
    """A name of letters, digits and _ only."""
    return "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in text)


def _number(value: float) -> str:
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "+Inf" if value > 0 else "-Inf"
    return str(value)


def _lines(name: str, metric: Metric) -> str:
    text = " ".join(metric.help.replace("\\", "/").replace('"', "'").split())
    lines = [
        f"# HELP {name} {text}",
        f"# TYPE {name} gauge",
        *([f"# UNIT {name} {metric.unit}"] if metric.unit else []),
    ]
    for labels, value in metric.samples.items():
        said = ",".join(f'{key}="{_escaped(label)}"' for key, label in labels)
        lines.append(f"{name}{{{said}}} {value}" if said else f"{name} {value}")
    return "\n".join(lines) + "\n"


def _escaped(label: str) -> str:
    printable = shown(label).encode("utf-8", "backslashreplace").decode()
    return printable.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
