# SPDX-License-Identifier: Apache-2.0
"""A device description as URDF, for whoever draws or plans with robots: its joints, their limits, a handle to see."""

from xml.etree import ElementTree

from haptic_device.config.description import Device
from haptic_device.message_fields import frame_id

_AXIS = {"x": "1 0 0", "y": "0 1 0", "theta": "0 0 1"}
_SEEN = {"base_link": ("box", {"size": "0.02 0.02 0.004"}), "handle": ("sphere", {"radius": "0.006"})}


def links(device: Device) -> tuple[str, ...]:
    """Names of the links, from base_link to handle: between two of them is the joint of an axis."""
    return "base_link", *(f"{axis.name}_link" for axis in device.axes[:-1]), "handle"


def urdf(device: Device, namespace: str) -> str:
    """The device as URDF: joints x, y, theta [m, m, rad] of the device, frames as `frame_id` has them in a namespace.

    A device has a mass for each axis and none for a link: no link has inertia.
    """
    robot = ElementTree.Element("robot", name=device.name)
    names = [frame_id(namespace, link) for link in links(device)]
    for name, link in zip(names, links(device), strict=True):
        _link(robot, name, *_SEEN.get(link, ("", {})))
    for axis, parent, child in zip(device.axes, names, names[1:], strict=False):
        kind = "revolute" if axis.name == "theta" else "prismatic"
        joint = ElementTree.SubElement(robot, "joint", name=axis.name, type=kind)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        ElementTree.SubElement(joint, "axis", xyz=_AXIS[axis.name])
        low, high = axis.workspace
        limits = {"lower": low, "upper": high, "velocity": axis.velocity_limit, "effort": axis.motor_limit}
        ElementTree.SubElement(joint, "limit", {name: repr(value) for name, value in limits.items()})
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _link(robot, name, shape, size):
    link = ElementTree.SubElement(robot, "link", name=name)
    if shape:
        geometry = ElementTree.SubElement(ElementTree.SubElement(link, "visual"), "geometry")
        ElementTree.SubElement(geometry, shape, size)
