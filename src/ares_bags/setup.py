# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_bags."""

from setuptools import find_packages, setup

PACKAGE = "ares_bags"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Record, read and check flights as rosbag2-conformant MCAP bags.",
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
        "ares_node",
        "mcap>=1.1",
        "mcap-ros2-support>=0.5",
        "numpy>=2.0",
        "PyYAML>=6.0",
        "zstandard>=0.19",
    ],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    entry_points={"console_scripts": ["recorder = ares_bags.__main__:main"]},
)
