# SPDX-License-Identifier: Apache-2.0
"""The progress bar."""

import pytest

from ares_bringup.progress import bar, search, search_line
from ares_optimizer.deadline import Progress


@pytest.mark.parametrize(
    ("terminal", "quiet", "shown"), [("1", False, True), ("1", True, False), ("0", False, False)]
)
def test_a_bar_is_for_terminals(monkeypatch, capsys, terminal, quiet, shown):
    monkeypatch.setenv("TTY_COMPATIBLE", terminal)
    with bar(quiet=quiet) as progress:
        task = progress.add_task("flying", total=3)
        for _ in range(3):
            progress.advance(task)
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


def test_a_mass_that_is_not_known_is_not_shown():
    assert search_line(Progress("indirect", 3, 1e-9)) == "indirect: iteration 3, violation 1.0e-09"
