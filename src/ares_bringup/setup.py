# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_bringup."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = "ares_bringup"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Launch files, node parameters and the ares command line.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["*.xml", "*.json", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.py"))),
        (f"share/{PACKAGE}/layouts", sorted(glob("layouts/*.json"))),
        (f"share/{PACKAGE}/params", sorted(glob("params/*.yaml"))),
        (f"share/{PACKAGE}/rviz", sorted(glob("rviz/*.rviz"))),
    ],
    python_requires=">=3.11",
    install_requires=[
        "ares_bags",
        "ares_guidance",
        "ares_models",
        "ares_node",
        "ares_optimizer",
        "ares_studies",
        "ares_vehicle_sim",
        "ares_view",
        "numpy>=2.0",
        "pydantic>=2.5",
        "rich>=13.7",
        "typer>=0.12",
    ],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "ares = ares_bringup.__main__:main",
            "judge = ares_bringup.__main__:judge",
        ]
    },
)
