"""A BIDS dataset with the datatype motion (BIDS 1.9 or newer): a run for each segment, with channels, events and its clock fit.

sub-01/motion/sub-01_task-recording_tracksys-ekso_run-1_motion.tsv    the rows; the channel `latency` is the host's clock by the fit
              ..._motion.json ..._channels.tsv ..._channels.json      rate, clock fit; units; the frame of the angles
              sub-01_task-recording_run-1_events.tsv                  marks, breaks and gaps
sub-01/sub-01_scans.tsv                                               when each run began
"""

from __future__ import annotations

import json
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Any

from handctl.errors import UsageError
from handctl.files import SPELLED
from handctl.record.clock_survey import BREAK, GAP
from handctl.record.csv_columns import clean
from handctl.record.exports import name_of
from handctl.record.log_reader import as_written

if TYPE_CHECKING:
    from handctl.record.exports import Export

SUBJECT, TASK = "sub-01", "recording"
ANGLES = ("deg", "°")
LATENCY = "latency"
NONE = "n/a"
FRAME = {
    "reference_frame": {
        "Description": "what a channel is measured against",
        "Levels": {
            "segment": "the angle between two parts of the device that a joint connects. Flexion has the sign of the device",
            "device": "the device itself, as its manual defines the quantity",
        },
    }
}
EVENTS = {
    "trial_type": {
        "Description": "what happened",
        "Levels": {
            "mark": "a mark that a person or a program set, at the time at which it arrived",
            GAP: "samples are missing. The duration is how long",
            BREAK: "the run begins: the port was lost, the device restarted, or its clock and the computer's drifted apart",
        },
    },
    "text": {"Description": "the text of the mark, or the reason"},
    "row": {"Description": "the row of the recording, from 1"},
}


def write(export: Export) -> None:
    """Write the folder; it is there whole or not at all."""
    if os.path.lexists(export.path):
        raise UsageError(f"{export.path} exists", hint="choose a new folder for the dataset", code="file-exists")
    part = f"{os.path.realpath(export.path)}.{os.getpid()}.part"
    shutil.rmtree(part, ignore_errors=True)  # of a process of this number that was killed
    try:
        _dataset(export, part)
        os.rename(part, export.path)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def _dataset(export: Export, folder: str) -> None:
    motion = os.path.join(folder, SUBJECT, "motion")
    os.makedirs(motion)
    kind, log = f"tracksys-{export.log.kind}", export.log
    simulated = " (simulated)" if log.simulated else ""
    _json(os.path.join(folder, "dataset_description.json"), {
        "Name": f"{name_of(export)}{simulated}", "BIDSVersion": "1.10.0", "DatasetType": "raw",
        "GeneratedBy": [{"Name": "handctl", "Version": export.tool.rpartition(" ")[2]}],
    })  # fmt: skip
    with open(os.path.join(folder, "README"), "w", encoding="utf-8", errors=SPELLED, newline="") as file:
        file.write(
            f"The recording {os.path.basename(log.path)} of the device family {log.kind}{simulated}, exported by {export.tool}.\n\n"
            "Each run is a segment of the recording: it ends where the port was lost, the device restarted, or its clock and the\n"
            "computer's drifted apart. Nothing was resampled. The channel `latency` has the time of each row since the start of its\n"
            "run by the clock of the recording computer, from the fit in `ClockFit` of the run's motion.json.\n"
        )
    _tsv(os.path.join(folder, "participants.tsv"), ("participant_id",), [(SUBJECT,)])
    _rows(export, os.path.join(motion, f"{SUBJECT}_task-{TASK}_{kind}_run-{{}}_motion.tsv"))
    scans = []
    for number, run in {number: f"run-{number}" for number in export.segments}.items():
        stem = f"{SUBJECT}_task-{TASK}_{kind}_{run}"
        channels = _channels(export)
        _json(os.path.join(motion, f"{stem}_motion.json"), _about(export, number, channels))
        _tsv(os.path.join(motion, f"{stem}_channels.tsv"), ("name", "component", "type", "tracked_point", "units", "reference_frame"), channels)  # fmt: skip
        _json(os.path.join(motion, f"{stem}_channels.json"), FRAME)
        begin = export.survey.segments[number].ends[0]
        moment = datetime.fromtimestamp(begin, timezone.utc)
        scans.append((f"motion/{stem}_motion.tsv", f"{moment:%Y-%m-%dT%H:%M:%S.%f}Z"))
        if rows := _events(export, number, begin):
            events = os.path.join(motion, f"{SUBJECT}_task-{TASK}_{run}_events")
            _tsv(f"{events}.tsv", ("onset", "duration", "trial_type", "text", "row"), rows)
            _json(f"{events}.json", EVENTS)
    _tsv(os.path.join(folder, SUBJECT, f"{SUBJECT}_scans.tsv"), ("filename", "acq_time"), scans)


def _rows(export: Export, files: str) -> None:
    """The rows of each run, as recorded, without a header: the channels file is it. `files` is their name, for the number."""
    names = [*_lead(export), *(channel.column for channel in export.log.channels)]
    begins, missing = dict[int, float](), NONE.encode()
    for number, block, utc in export.blocks(as_written):
        begin = begins.setdefault(number, utc[0])
        columns: list[Sequence[bytes]] = [[b"%.6f" % (time - begin) for time in utc]]
        for name in names:
            texts = block.columns[name]
            columns.append([text or missing for text in texts] if b"" in texts else texts)
        with open(files.format(number), "ab") as file:
            file.write(b"\n".join(map(b"\t".join, zip(*columns, strict=True))) + b"\n")


def _lead(export: Export) -> list[str]:
    return [name for name, _ in export.log.lead if name not in ("segment",)]


def _channels(export: Export) -> list[tuple[str, ...]]:
    """Name, component, type, tracked point, unit and frame of each column."""
    found: list[tuple[str, ...]] = [(LATENCY, NONE, "LATENCY", NONE, "s", NONE)]
    for name in _lead(export):
        unit = next((unit for unit in ("ms", "s") if name.endswith(f"_{unit}")), NONE)
        found.append((name, NONE, "MISC", NONE, unit, NONE))
    for one in export.log.channels:
        name, _, part = one.name.partition(".")
        joint = one.unit in ANGLES and ("angle" in name or "joint" in name)
        point = part or name.removesuffix("_angle")
        unit = "deg" if one.unit in ANGLES else one.unit or NONE
        found.append((one.column, NONE, "JNTANG" if joint else "MISC", point, unit, "segment" if joint else "device"))
    return found


def _about(export: Export, number: int, channels: Sequence[tuple[str, ...]]) -> dict[str, Any]:
    log, segment = export.log, export.survey.segments[number]
    first, last = export.survey.segments[number].ends
    counts = Counter(kind for _, _, kind, *_ in channels)
    rate = export.nominal_hz or 0.0
    sidecar = log.sidecar or {}
    return {
        "TaskName": TASK,
        "TrackingSystemName": f"handctl {log.kind}",
        "SamplingFrequency": rate,
        "SamplingFrequencyEffective": round((segment.rows - 1) / (last - first), 3) if last > first else rate,
        "RecordingType": "continuous" if not segment.gaps else "discontinuous",
        "RecordingDuration": round(last - first, 3),
        "MotionChannelCount": len(channels),
        **{f"{kind}ChannelCount": counts[kind] for kind in sorted(counts)},
        "TrackedPointsCount": len({point for _, _, kind, point, *_ in channels if kind == "JNTANG"}),
        "MissingValues": NONE,
        "ClockFit": segment.as_export(),
        "SettingsBefore": sidecar.get("settings_before"),
        "Simulated": log.simulated,
    }


def _events(export: Export, number: int, begin: float) -> list[tuple[str, ...]]:
    segment = export.survey.segments[number]
    found: list[tuple[float, tuple[str, ...]]] = []
    for one in export.events:
        if segment.first_row <= one.row < segment.first_row + segment.rows:
            long = float(one.text.split()[1]) if one.kind == GAP else 0.0
            text = clean(one.text)
            onset = one.utc_s - begin - long
            found.append((onset, (f"{onset:.6f}", f"{long:.3f}", one.kind, text, str(one.row))))
    return [row for _, row in sorted(found)]


def _json(path: str, content: dict[str, Any]) -> None:
    with open(path, "w", encoding="utf-8", errors=SPELLED, newline="") as file:
        json.dump(content, file, indent=1, ensure_ascii=False, allow_nan=False)


def _tsv(path: str, names: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    with open(path, "w", encoding="utf-8", errors=SPELLED, newline="") as file:
        file.writelines("\t".join(row) + "\n" for row in (names, *rows))
