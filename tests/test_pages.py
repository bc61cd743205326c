# SPDX-License-Identifier: Apache-2.0
"""Every page that is a file, in a browser: legible, without serious faults.

What is on a page is tested beside what makes it; the live page in test_live_page.py.
"""

import pytest

from ares_trials.testing.pages import FIGURES, illegible

PAGES = ("page_of_one", "page_of_two", "page_of_many", "page_of_map", "page_of_thesis")


@pytest.mark.parametrize(
    ("size", "theme"),
    [
        ("narrow", "dark"),
        ("wide", "light"),
        pytest.param("narrow", "light", marks=pytest.mark.trial),
        pytest.param("wide", "dark", marks=pytest.mark.trial),
    ],
)
@pytest.mark.parametrize("which", PAGES)
def test_a_page_is_legible_and_has_no_serious_fault(
    open_file, request, serious_faults, which, size, theme
):
    page = open_file(request.getfixturevalue(which), size, theme)
    assert illegible(page, size) == []
    figures = page.evaluate(FIGURES)
    assert figures
    assert all(figure["height"] > 250 for figure in figures)
    if size == "narrow":
        assert serious_faults(page) == []
