# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_trials."""

from setuptools import find_packages, setup

PACKAGE = "ares_trials"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Trials of the product: faults, every input, restarts, random vehicles.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed", "*/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "ares_bags",
        "ares_bringup",
        "ares_guidance",
        "ares_models",
        "ares_node",
        "ares_optimizer",
        "ares_studies",
        "ares_vehicle_sim",
        "numpy>=2.0",
        "pydantic>=2.5",
        "rich>=13.7",
        "typer>=0.12",
    ],
    # the test helpers in `testing/` need pytest too
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    entry_points={"ares_bringup.verbs": ["faults = ares_trials.faults.verb:faults"]},
)
