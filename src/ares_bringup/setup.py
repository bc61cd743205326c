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
    package_data={PACKAGE: ["*.xml", "*/*.yaml", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.py"))),
        (f"share/{PACKAGE}/params", sorted(glob("params/*.yaml"))),
    ],
    python_requires=">=3.11",
    zip_safe=False,
    entry_points={"console_scripts": ["ares = ares_bringup.cli:main"]},
)
