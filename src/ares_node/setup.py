# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_node."""

from setuptools import find_packages, setup

PACKAGE = "ares_node"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="What every Ares node shares: process entry, lifecycle base, parameters, QoS.",
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
    install_requires=["numpy>=2.0"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
)
