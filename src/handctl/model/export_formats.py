"""The formats that a recording of any family can be exported to; `record.exports` has a writer for each. Loaded with every family's commands: nothing heavy."""

from __future__ import annotations

from handctl.fast_classes import NamedTuple


class Format(NamedTuple):
    """What a format is for people, a name for its file, the library that it needs, and whether it takes a rate."""

    about: str
    example: str
    library: str = ""
    rated: bool = False


FORMATS = {
    "parquet": Format("columns with types and units, for pandas", "walk.parquet", "pyarrow"),
    "bids": Format("a BIDS motion dataset", "walk-bids"),
    "c3d": Format("motion capture, at a constant rate", "walk.c3d", rated=True),
    "mcap": Format("messages, for Foxglove and ROS tools", "walk.mcap", "mcap"),
    "xdf": Format("streams, as LabRecorder writes them", "walk.xdf"),
}
