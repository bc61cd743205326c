# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_guidance."""

from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "ares_guidance"
#: Each module of this folder is a law of its name.
LAWS = sorted(path.stem for path in Path("ares_guidance/laws").glob("[a-z]*.py"))

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Powered explicit guidance as compiled functions, and its lifecycle node.",
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
        "ares_optimizer",
        "numpy>=2.0",
    ],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    entry_points={
        "console_scripts": ["guidance = ares_guidance.__main__:main"],
        "ares_guidance.laws": [
            "peg = ares_guidance.law:PEG",
            *(f"{name} = ares_guidance.laws.{name}:LAW" for name in LAWS),
        ],
    },
)
