# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_optimizer."""

from setuptools import find_packages, setup

PACKAGE = "ares_optimizer"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Direct and indirect solutions of the optimal ascent.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "ares_models",
        "ares_node",
        "numpy>=2.0",
    ],
    extras_require={
        # what solves and what is drawn; no plain flight needs it
        "solve": ["ipyopt>=0.12", "scipy>=1.13"],
        "test": ["pytest"],
    },
    zip_safe=False,
    entry_points={"console_scripts": ["optimizer = ares_optimizer.__main__:main"]},
)
