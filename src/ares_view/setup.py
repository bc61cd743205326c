# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_view."""

from setuptools import find_packages, setup

PACKAGE = "ares_view"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Flights as they happen: standard messages, a live page in the browser.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed", "*/*.html", "*/*.css", "*/*.js"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "ares_bags",
        "ares_models",
        "ares_node",
        "ares_studies",
        "numpy>=2.0",
    ],
    extras_require={
        # the live page; no flight needs it
        "live": ["plotly>=5.20", "tornado>=6.4"],
        # the live connection to Foxglove
        "pages": ["foxglove-sdk>=0.30"],
        "test": ["pytest"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "live = ares_view.live.__main__:main",
            "view = ares_view.standard.__main__:main",
        ]
    },
)
