# SPDX-License-Identifier: Apache-2.0
"""Packaging of ares_studies."""

from setuptools import find_packages, setup

PACKAGE = "ares_studies"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Whole flights without ROS, in one compiled loop.",
    license="Apache-2.0",
    maintainer="Ares maintainers",
    maintainer_email="ares-maintainers@example.org",
    packages=find_packages(exclude=["test", "test.*"]),
    package_data={PACKAGE: ["py.typed", "*/*.html", "*/*.css", "*/*.js", "*/*.json", "*/*.md"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "ares_guidance",
        "ares_models",
        "ares_optimizer",
        "ares_vehicle_sim",
        "numpy>=2.0",
    ],
    extras_require={
        # campaigns, pages, pictures, tables; no flight needs them
        "pages": [
            "distributed>=2024.5",
            "Jinja2>=3.1",
            "MarkupSafe>=2.1",
            "matplotlib>=3.9",
            "plotly>=5.20",
            "pyarrow>=16.1",
            "scipy>=1.13",
        ],
        # what the live page takes of the pages
        "live": ["Jinja2>=3.1", "MarkupSafe>=2.1", "plotly>=5.20"],
        "solve": ["scipy>=1.13"],
        "test": ["pytest"],
    },
    zip_safe=False,
)
