# SPDX-License-Identifier: Apache-2.0
"""All metadata of the package; pyproject.toml holds tools only, because colcon cannot read a [project] table here."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "haptic_display"
PACKAGES = ("haptic_device", "haptic_sim", "haptic_display")
SHARE = f"share/{NAME}"
README = Path(__file__).resolve().parent / "README.md"  # colcon build --symlink-install runs this elsewhere

FIRMWARE = (".c", ".h", ".ino", ".md")  # kinds of its files

ROS = [
    "ros-jazzy-rclpy[fastrtps]>=7.1",
    "ros-jazzy-common-interfaces>=5.3",
    "ros-jazzy-lifecycle-msgs>=2.0",
]
DATAFRAME = ["pandas>=2.2", "polars>=1.0"]
BENCH = [
    "mujoco>=4",
    "pillow>=10.1",
    "pyb2d3>=0.11.1",
]
SWEEP = ["distributed>=2024.8"]
BROWSER = [
    "axe-playwright-python>=0.1.4",
    "playwright>=1.50",
]
DOCS = [
    "latex2mathml>=3.79",
    "mkdocs-material>=9.7",
    "mkdocstrings[python]>=1.0",
]
MAKERS = ["HaplyHAPI>=1.0.1", "moteus>=1.1"]  # the makers' own clients, which tests compare the links with
NOTEBOOKS = ["marimo>=0.25"]
TEST = [
    "colcon-common-extensions>=0.3",
    "control>=0.10",
    "hypothesis>=6.100",
    "import-linter>=2.3",
    "mypy>=1.15",
    *DATAFRAME,
    *DOCS,
    *MAKERS,
    *NOTEBOOKS,
    *SWEEP,
    "pytest>=8",
    "pytest-timeout>=2.3",
    "pytest-xdist>=3.5",
    "ruff>=0.9",
    "setuptools>=70.1,<80",
]


def installed_files():
    """(target folder, files) pairs: everything that is not a Python module, in the places where ROS 2 looks."""
    kinds = (".yaml", ".xml", ".json", ".rviz")
    files = sorted(path for path in Path("config").rglob("*") if path.suffix in kinds)
    folders = sorted({path.parent for path in files})
    config = [(f"{SHARE}/{folder}", [str(path) for path in files if path.parent == folder]) for folder in folders]
    programs = "launch", "examples", "examples/notebooks"
    python = [(f"{SHARE}/{folder}", sorted(map(str, Path(folder).glob("*.py")))) for folder in programs]
    sources = sorted(path for path in Path("firmware").rglob("*") if path.suffix in FIRMWARE or path.name == "Makefile")
    kept = sorted({path.parent for path in sources})
    firmware = [(f"{SHARE}/{folder}", [str(path) for path in sources if path.parent == folder]) for folder in kept]
    # Launchers under lib/ let `ros2 run` find the executables after a plain pip install too.
    scripts = [(f"lib/{NAME}", [str(path) for path in sorted(Path("scripts").iterdir()) if path.is_file()])]
    index = [("share/ament_index/resource_index/packages", [f"resource/{NAME}"]), (SHARE, ["package.xml"])]
    measured = [(f"{SHARE}/docs/benchmarks", ["docs/benchmarks/speed_error.csv"])]  # a notebook's
    return index + config + firmware + measured + python + scripts


setup(
    name=NAME,
    version="0.1.0",
    description="Haptic display of tool use: a virtual tool coupled to a haptic device's handle, passive by design.",
    long_description=README.read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    # No public address yet: RFC 2606 reserves .example. Whoever publishes the package puts theirs, and a url, here and
    # in package.xml.
    maintainer="haptic_display maintainers",
    maintainer_email="maintainers@haptic-display.example",
    license="Apache-2.0",
    python_requires=">=3.11",
    packages=find_packages(include=[f"{name}{below}" for name in PACKAGES for below in ("", ".*")]),
    package_data={
        **{name: ["py.typed"] for name in PACKAGES},
        "haptic_display.page.film": ["web/*"],
        "haptic_sim.reduction": ["*.csv"],
        "haptic_display.page": ["web/*"],
        "haptic_display.run.report": ["*.css"],
    },
    data_files=installed_files(),
    zip_safe=False,
    install_requires=[
        "aiohttp>=3.9",
        "llvmlite>=0.43",
        "matplotlib>=3.8",
        "mcap>=1.6",
        "numba>=0.68",
        "numpy>=1.26",
        "psutil>=5.9",
        "pydantic>=2",
        "pymunk>=7",
        "pyserial>=3.5",
        "python-fcl>=0.7",
        "pyyaml>=6",
        "rich>=13",
        "rosbags>=0.10",
        "scipy>=1.11",
        "typer>=0.12",
        "zstandard>=0.22",
    ],
    extras_require={
        "bench": BENCH,
        "browser": BROWSER,
        "dataframe": DATAFRAME,
        "docs": DOCS,
        "makers": MAKERS,
        "notebooks": NOTEBOOKS,
        "ros": ROS,
        "sweep": SWEEP,
        "test": TEST,
    },
    entry_points={
        "console_scripts": [
            "haptic = haptic_display.cli.main:main",
            "haptic_bridge = haptic_device.nodes:haptic_bridge",
            "haptic_driver = haptic_device.nodes:haptic_driver",
            "haptic_loopback = haptic_device.nodes:haptic_loopback",
            "haptic_recorder = haptic_device.nodes:haptic_recorder",
            "haptic_simulation = haptic_sim.node:haptic_simulation",
            "haptic_viewer = haptic_display.page:haptic_viewer",
        ],
    },
)
