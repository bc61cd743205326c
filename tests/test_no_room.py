# SPDX-License-Identifier: Apache-2.0
"""A full disk under a command's output: one line, status 2, no partial file."""

import importlib.util
import resource
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"


@pytest.fixture
def room(monkeypatch) -> Iterator[Callable[[int], None]]:
    """Set the bytes that a file may have, as a full disk does; none once the test is over.

    Compiled modules are not written meanwhile: Python keeps them cut.
    """
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda limit: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("bytes_", [1_000, 9_000])
def test_a_campaign_that_cannot_begin_leaves_nothing(ares, tmp_path, room, bytes_):
    """Fill the disk before its settings, and before its first flights."""
    room(bytes_)
    done = ares("montecarlo", "-n", "300", "--out", str(tmp_path / "new"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"ares: {tmp_path / 'new'}: File too large")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
    there = tmp_path / "there"
    there.mkdir()
    assert ares("montecarlo", "-n", "300", "--out", str(there)).returncode == 2
    assert list(there.iterdir()) == []


def test_a_campaign_keeps_what_was_flown_and_goes_on(ares, tmp_path, room):
    folder = tmp_path / "campaign"
    words = ("montecarlo", "-n", "1000", "--out", str(folder), "--workers", "2")
    room(120_000)
    done = ares(*words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"ares: {folder}: File too large; 1,000 flights are in it, the same command with "
        f"--out {folder} goes on\n"
    )
    assert sorted(path.name for path in folder.iterdir()) == ["campaign.json", "parts"]
    assert {path.suffix for path in (folder / "parts").iterdir()} == {".parquet"}
    room(resource.getrlimit(resource.RLIMIT_FSIZE)[1])
    assert ares(*words).returncode == 0
    assert pq.read_metadata(folder / "flights.parquet").num_rows == 1000


@pytest.mark.parametrize(
    ("verb", "name"),
    [
        (("plot",), "x.png"),
        *(pytest.param(("plot",), name, marks=pytest.mark.trial) for name in ("x.pdf", "x.svg")),
        (("report",), "x.html"),
        (("export", "--format", "parquet"), "x.parquet"),
    ],
)
def test_a_flight_that_cannot_be_shown_leaves_nothing(ares, tmp_path, room, verb, name):
    room(8_000)
    done = ares(*verb, str(REFERENCE), "--out", str(tmp_path / name))
    assert (done.returncode, done.stdout) == (2, "")
    said = f"ares: --out is '{tmp_path / name}', which cannot be written: File too large\n"
    # before it what a library says that keeps a cache of fonts
    assert done.stderr.endswith(said)
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "work"),
    [
        (("optimize", "--out", "{file}/x.html"), "ares_bringup.commands.optimize.solve"),
        (("aborts", "--out", "{file}/x.html"), "ares_bringup.commands.aborts.MapMaker"),
        (("montecarlo", "--out", "{file}/new"), "ares_bringup.commands.montecarlo.rehearse"),
        (("fly", "--bag", "{file}/bag"), "ares_bringup.fly.rehearse"),
        (
            ("report", str(REFERENCE), "--out", "{file}/x.html"),
            "ares_bringup.commands.report.make_flight",
        ),
        (
            ("plot", str(REFERENCE), "--out", "{file}/x.png"),
            "ares_bringup.commands.plot.make_flight",
        ),
        (
            ("export", str(REFERENCE), "--format", "csv", "--out", "{file}/x.csv"),
            "ares_bringup.commands.export._exported",
        ),
    ],
)
def test_what_cannot_be_kept_is_not_begun(ares, tmp_path, monkeypatch, words, work):
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setattr(work, lambda *_args, **_named: pytest.fail("the work has begun"))
    done = ares(*(word.format(file=file) for word in words))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.endswith(": Not a directory\n")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("option", ["--start", "--end"])
@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e300"])
def test_a_time_that_is_none_is_one_line(ares, option, value):
    done = ares("replay", str(REFERENCE), f"{option}={value}")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"ares: {option} is '{value}'; expected at ")
    assert done.stderr.count("\n") == 1


def test_a_kernel_that_finds_no_room_is_used_all_the_same(tmp_path, monkeypatch, room):
    path = tmp_path / "one.py"
    path.write_text(
        "from ares_models.jit import kernel\n\n\n@kernel\ndef inner(x):\n    return x + 1.0\n\n\n"
        "@kernel\ndef outer(x):\n    return 2.0 * inner(x)\n"
    )
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "cache"))
    spec = importlib.util.spec_from_file_location("one", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    room(1_000)
    assert module.outer(1.0) == 4.0
    assert list(tmp_path.rglob("*.nbc")) == []
