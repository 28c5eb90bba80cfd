# SPDX-License-Identifier: Apache-2.0
"""What a bag says of how it was made, as attachments: trial, program and machine, each node's parameters, files."""

from pathlib import Path

from haptic_device.config.files import find
from haptic_device.config.parameter_sections import SECTION
from haptic_device.config.yaml_reader import dump

YAML = "application/yaml"
FILES = {"device": "devices", "scene": "scenes"}  # parameters that name a file, and its folder in config


def trial_of(values: dict) -> dict[str, str]:
    """Participant, condition and fields of the recorder's parameters, those that are given. Raises ValueError."""
    trial = {name: values[f"trial.{name}"] for name in ("participant", "condition")}
    for field in filter(None, values["trial.fields"]):
        name, separator, content = field.partition("=")
        if not separator or not name:
            raise ValueError(f"trial.fields has {field!r}; write name=value")
        trial[name] = content
    return {name: content for name, content in trial.items() if content}


def parameter_file(namespace: str, node: str, values: dict) -> bytes:
    """A node's parameters as a ROS 2 parameter file, so that a run can be repeated with it."""
    return dump({f"{namespace.rstrip('/')}/{node}": {SECTION: values}}).encode()


def files_of(values: dict) -> dict[str, bytes]:
    """Content of the device description and the scene that a node's parameters name, by the name of the attachment."""
    contents = {}
    for parameter, folder in FILES.items():
        if values.get(parameter):
            try:
                path = find(folder, values[parameter])
                contents[f"{parameter}/{path.name}"] = Path(path).read_bytes()
            except OSError:  # of another computer, or relative to that node's folder
                continue
    return contents
