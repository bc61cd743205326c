# SPDX-License-Identifier: Apache-2.0
"""The progress bar."""

import re
import time

import pytest

from ares_bringup import progress
from ares_bringup.progress import bar, search, search_line
from ares_optimizer.deadline import Progress


@pytest.mark.parametrize(
    ("terminal", "quiet", "shown"), [("1", False, True), ("1", True, False), ("0", False, False)]
)
def test_a_bar_is_for_terminals(monkeypatch, capsys, terminal, quiet, shown):
    monkeypatch.setenv("TTY_COMPATIBLE", terminal)
    with bar(quiet=quiet) as shown_bar:
        task = shown_bar.add_task("flying", total=3)
        for _ in range(3):
            shown_bar.advance(task)
    said = capsys.readouterr()
    assert ("3/3" in said.err) is shown
    assert said.out == ""


@pytest.mark.parametrize(
    ("terminal", "quiet", "shown"), [("1", False, True), ("1", True, False), ("0", False, False)]
)
def test_a_search_is_shown_on_terminals(monkeypatch, capsys, terminal, quiet, shown):
    monkeypatch.setenv("TTY_COMPATIBLE", terminal)
    with search(quiet=quiet) as tell:
        tell(Progress("collocation", 17, 2.5e-4, 174_183.14))
    said = capsys.readouterr()
    assert ("collocation: iteration 17, violation 2.5e-04, 174,183.1 kg" in said.err) is shown
    assert said.out == ""


def test_a_long_search_is_told_of_in_lines_where_there_is_no_terminal(monkeypatch, capsys):
    monkeypatch.setenv("TTY_COMPATIBLE", "0")
    monkeypatch.setattr(progress, "FIRST_LINE_S", 0.05)
    monkeypatch.setattr(progress, "NEXT_LINE_S", 0.05)
    lines = []

    def wait_for(text):
        while not any(text in line for line in lines):
            # however long it takes on a busy machine
            time.sleep(0.01)
            lines.extend(re.sub(r"\d+ s\n", "0 s\n", capsys.readouterr().err).splitlines())

    with search() as tell:
        wait_for("searching")
        tell(Progress("indirect", 3, 1e-9))
        wait_for("indirect")
    assert lines[0] == "ares: searching, 0 s"
    assert lines[-1] == "ares: indirect: iteration 3, violation 1.0e-09, 0 s"


def test_a_quiet_search_is_not_told_of(monkeypatch, capsys):
    monkeypatch.setenv("TTY_COMPATIBLE", "0")
    monkeypatch.setattr(progress, "FIRST_LINE_S", 0.05)
    with search(quiet=True):
        time.sleep(0.2)
    assert capsys.readouterr() == ("", "")


def test_a_mass_that_is_not_known_is_not_shown():
    assert search_line(Progress("indirect", 3, 1e-9)) == "indirect: iteration 3, violation 1.0e-09"
