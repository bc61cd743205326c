# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_vehicle_sim."""

from setuptools import find_packages, setup

PACKAGE = "ares_vehicle_sim"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The true vehicle as compiled functions, and the node that owns the clock.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed", "data/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "ares_models",
        "ares_node",
        "numpy>=2.0",
        "pydantic>=2.5",
    ],
    extras_require={
        # for solving and for draws; a plain flight does not need it
        "solve": ["scipy>=1.13"],
        "test": ["pytest"],
    },
    zip_safe=False,
    entry_points={"console_scripts": ["vehicle_sim = ares_vehicle_sim.__main__:main"]},
)
