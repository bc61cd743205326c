# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_models."""

from setuptools import find_packages, setup

PACKAGE = "ares_models"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Physics and mission data: gravity, Earth, atmospheres, orbits. No ROS.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["missions/*.yaml", "data/*.yaml", "data/**/*.csv", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "numba>=0.60",
        "numpy>=2.0",
        "pydantic>=2.5",
        "pymsis>=0.9",
        "PyYAML>=6.0",
    ],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
)
