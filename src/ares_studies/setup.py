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
    package_data={PACKAGE: ["py.typed", "*/*.yaml", "*/*.html", "*/*.css", "*/*.js"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    zip_safe=False,
)
