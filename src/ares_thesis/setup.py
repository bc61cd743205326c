# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_thesis."""

from setuptools import find_packages, setup

PACKAGE = "ares_thesis"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="A thesis on ascent guidance: its own methods and law, its tables and figures.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed", "*/*.yaml", "*/*.html"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "ares_bringup",
        "ares_guidance",
        "ares_models",
        "ares_optimizer",
        "ares_studies",
        "ares_vehicle_sim",
        "numpy>=2.0",
        "PyYAML>=6.0",
        "rich>=13.7",
        "typer>=0.19",
    ],
    extras_require={
        # the study of transients
        "pages": ["scipy>=1.13"],
        "test": ["pytest"],
    },
    zip_safe=False,
    entry_points={
        "ares_bringup.optimize": ["analytic = ares_thesis.verbs:optimize_analytic"],
        "ares_bringup.published": ["ares_v = ares_thesis.commands.published:table_4_1"],
        "ares_bringup.verbs": ["reproduce = ares_thesis.verbs:reproduce"],
        "ares_guidance.laws": ["peg_thesis = ares_thesis.peg.law:LAW"],
        "ares_optimizer.methods": ["analytic = ares_thesis.analytic.method:ANALYTIC"],
    },
)
