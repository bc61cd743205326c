"""The bar of what takes long."""

import pytest

from ares_bringup.progress import bar


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
