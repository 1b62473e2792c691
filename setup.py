"""Install the three MAVProxy modules: uavapi, vision and gradys."""

from pathlib import Path

from setuptools import find_packages, setup

VISION = ["opencv-python-headless>=4.10", "numpy>=1.26"]
MQTT = ["aiomqtt>=2.3"]
TEST = [
    "pytest>=8",
    "pytest-xdist>=3.5",
    "pytest-rerunfailures>=14",
    "hypothesis>=6.100",
    "schemathesis>=4",
    "requests>=2.31",
    "setuptools>=70.1",
]
LINT = ["ruff>=0.6", "mypy>=1.11", "types-psutil", "types-requests"]

setup(
    name="mavproxy-uavapi",
    version="0.1.0",
    description="MAVProxy modules: an HTTP API, AprilTag landing and ground-station push for ArduPilot vehicles",
    long_description=Path(__file__).with_name("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="GPL-3.0-or-later",
    python_requires=">=3.10",
    packages=find_packages(include=["mavproxy_*"]),
    package_data={"": ["py.typed"]},
    # MAVProxy's `module load NAME` imports the top-level module of that name.
    py_modules=["uavapi", "vision", "gradys"],
    install_requires=[
        "MAVProxy>=1.8.71",
        "pymavlink>=2.4.42",
        "aiohttp>=3.10",
        "psutil>=6",
        "pydantic>=2.7",
        "swagger-ui-py>=25.7.1",  # the files of Swagger UI 5 for /docs, which OpenAPI 3.1 needs
    ],
    extras_require={
        "vision": VISION,
        "mqtt": MQTT,
        "test": TEST + VISION + MQTT,
        "lint": LINT,
        "dev": TEST + VISION + MQTT + LINT,
    },
    entry_points={"console_scripts": ["mavproxy-uavapi = mavproxy_uavapi.launcher:main"]},
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Programming Language :: Python :: 3.10",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Programming Language :: Python :: 3.13",
        "Topic :: Scientific/Engineering",
    ],
)
