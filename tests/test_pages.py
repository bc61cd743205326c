# SPDX-License-Identifier: Apache-2.0
"""Every page that is a file, in a browser: legible, without serious faults.

What is on a page is tested beside what makes it, and so is one of its looks; the live page in
test_live_page.py.
"""

import pytest

PAGES = ("page_of_one", "page_of_two", "page_of_many", "page_of_map", "page_of_thesis")
LOOKS = (("narrow", "dark"), ("wide", "light"), ("narrow", "light"), ("wide", "dark"))


@pytest.mark.trial
@pytest.mark.parametrize(("size", "theme"), LOOKS)
@pytest.mark.parametrize("which", PAGES)
def test_a_page_is_legible_and_has_no_serious_fault(
    open_file, request, check_page, which, size, theme
):
    check_page(open_file(request.getfixturevalue(which), size, theme), size)
