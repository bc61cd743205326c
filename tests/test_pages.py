# SPDX-License-Identifier: Apache-2.0
"""Every page that is a file, in a browser: legible, without serious faults.

What is on a page is tested beside what makes it; the live page in test_live_page.py.
"""

import pytest

from ares_trials.testing.pages import FIGURES, illegible

PAGES = ("page_of_one", "page_of_two", "page_of_many", "page_of_map", "page_of_thesis")
LOOKS = (("narrow", "dark"), ("wide", "light"), ("narrow", "light"), ("wide", "dark"))


@pytest.mark.parametrize(
    ("which", "size", "theme"),
    [
        # the first two in turn; `make trials` takes all of every page
        pytest.param(which, *look, marks=[] if look == LOOKS[k % 2] else pytest.mark.trial)
        for k, which in enumerate(PAGES)
        for look in LOOKS
    ],
)
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
