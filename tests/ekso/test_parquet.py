"""`export --to parquet`, read back by pyarrow and pandas where they are installed; and what is said where they are not."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.ekso.log_reader import LogFile
from tests.ekso.recordings import make
from tests.support.cli import run
from tests.support.each_row import each_row


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return make(tmp_path / "a.csv", [1001, 1021, 1041, 301, 331], mark="go", raw=True)


def test_every_value_unit_and_mark_comes_back(log: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    out = log.with_name("a.parquet")
    done = run("ekso", "export", log, "--to", "parquet", "-o", out, "--json")
    assert done.code == 0 and done.rows == [{"file": str(out), "rows": 5, "seconds": pytest.approx(2, abs=3)}]
    table: Any = parquet.read_table(out)
    names = LogFile(str(log)).names
    assert tuple(table.column_names) == (*names, "host_fit_s")
    recorded = list(csv.DictReader(log.open(encoding="utf-8", newline="")))
    for name in names:
        about = {key.decode(): text.decode() for key, text in (table.schema.field(name).metadata or {}).items()}
        values = table.column(name).to_pylist()
        if "decimals" not in about:
            assert values == [row[name] or None for row in recorded], name
        else:
            assert [f"{value:.{about['decimals']}f}" for value in values] == [row[name] for row in recorded], name
    assert table.schema.field("torso_pitch_deg").metadata[b"unit"] == b"deg"
    assert json.loads(table.schema.metadata[b"handctl"])["log"]["rows"] == 5


def test_pandas_takes_it(log: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    out = log.with_name("a.parquet")
    assert run("ekso", "export", log, "--to", "parquet", "--segment", "2", "-o", out).code == 0
    frame = pandas.read_parquet(out)
    assert list(frame["segment"]) == [2, 2] and frame["torso_pitch_deg"].dtype == "float64"


def test_without_the_extra_it_says_what_to_install(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = run("ekso", "export", log, "--to", "parquet", "-o", log.with_name("a.parquet"), "--json")
    assert (done.code, done.error["code"]) == (2, "no-extra") and "handctl[parquet]" in done.error["hint"]
    assert not log.with_name("a.parquet").exists()


@each_row("args", [("--si",), ("--rate", "50"), ("--knee-sign", "1"), ("-o", "-"), ()])
def test_impossible_exports(log: Path, args: tuple[str, ...]) -> None:
    assert run("ekso", "export", log, "--to", "parquet", *args).code == 2


def test_a_damaged_log_leaves_no_file(log: Path) -> None:
    pytest.importorskip("pyarrow")
    out = log.with_name("a.parquet")
    log.write_bytes(log.read_bytes().replace(b",4.50,", b",4.5O,", 1))
    done = run("ekso", "export", log, "--to", "parquet", "-o", out)
    assert done.code == 2 and "corrupted" in done.err and not out.exists()


ELSEWHERE = """
from handctl.record.exports import parquet
parquet._library()
import pyarrow.fs
assert pyarrow.fs.S3FileSystem
"""


WITHOUT_SSL = """
import sys
from handctl import lazy_stdlib
from handctl.record.exports import parquet
lazy_stdlib.own_process = True
parquet._library()
assert not {"ssl", "_ssl"} & set(sys.modules)
import ssl
assert ssl.get_default_verify_paths().openssl_cafile
"""


@pytest.mark.real
def test_an_export_of_our_own_loads_nothing_that_encrypts() -> None:
    """5 MB that no file on this computer needs."""
    pytest.importorskip("pyarrow")
    assert subprocess.run([sys.executable, "-c", WITHOUT_SSL], check=False).returncode == 0


@pytest.mark.real
def test_a_program_that_has_exported_still_reaches_files_elsewhere() -> None:
    """What the export leaves out to save memory is missed by nobody else in the process."""
    pytest.importorskip("pyarrow._s3fs")
    assert subprocess.run([sys.executable, "-c", ELSEWHERE], check=False).returncode == 0
