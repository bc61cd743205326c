# SPDX-License-Identifier: Apache-2.0
"""`ares reproduce`: location of the files, and refusals. The page has its own test."""

import json

import pytest

import ares_thesis.commands.reproduce as verb
from ares_bringup.commands.cli import main


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Replace the report by a stub: only writing is tested."""
    monkeypatch.setattr(verb, "make_report", lambda progress: progress("one"))
    monkeypatch.setattr(verb, "dump", lambda report: json.dumps({"report": report}))
    monkeypatch.setattr(verb, "render", lambda _, data, name: f"<p>{data} {name}</p>")


def test_two_files_in_a_folder_of_their_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce"]) == 0
    found = sorted(path.name for path in (tmp_path / "reproduction").iterdir())
    assert found == ["reproduction.html", "reproduction.json"]
    captured = capsys.readouterr()
    assert [line.split()[0] for line in captured.out.splitlines()] == [
        "reproduction/reproduction.html",
        "reproduction/reproduction.json",
    ]
    assert captured.err == ""


def test_a_second_call_replaces_the_files(tmp_path):
    out = tmp_path / "a" / "b"
    for _ in range(2):
        assert main(["reproduce", "--out", str(out)]) == 0
    assert len(list(out.iterdir())) == 2


def test_a_file_as_out_is_one_line(tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("mine")
    for out in (file, file / "below"):
        assert main(["reproduce", "--out", str(out)]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.count("\n") == 1
        assert f"--out is '{out}'" in captured.err
    assert file.read_text() == "mine"


def test_nothing_is_half_written(tmp_path, monkeypatch, capsys):
    def full(_path, _target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    assert main(["reproduce", "--out", str(tmp_path / "out")]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_missing_result_is_one_line(tmp_path, monkeypatch, capsys):
    def fail(_progress):
        raise verb.OptimizerError("direct11 on ares_v: no flight")

    monkeypatch.setattr(verb, "make_report", fail)
    assert main(["reproduce", "--out", str(tmp_path / "out")]) == 2
    assert "a result is missing: direct11" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_help(capsys):
    assert main(["reproduce", "--help"]) == 0
    assert "every table and figure of the thesis" in capsys.readouterr().out
