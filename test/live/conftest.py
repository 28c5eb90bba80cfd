# SPDX-License-Identifier: Apache-2.0
"""One display for all tests of a worker that only ask it something; a module's NODES say what is to run in /haptic."""

import contextlib

import pytest
from ear import Ear
from live_nodes import Nodes


def pytest_collection_modifyitems(items):
    """Modules that share nodes follow each other."""
    items.sort(key=lambda item: not hasattr(item.module, "NODES"))


@pytest.fixture(scope="session")
def _worker_nodes(ros_domain, tmp_path_factory):
    with Nodes(tmp_path_factory.mktemp("nodes")) as nodes:
        yield nodes


@pytest.fixture(scope="module", autouse=True)
def nodes(request, _worker_nodes):
    """The nodes in /haptic: those that the module wants, where possible as they run already, and no others."""
    wanted = getattr(request.module, "NODES", {})
    _worker_nodes.lack(*(_worker_nodes.running.keys() - wanted.keys()))
    for name, given in wanted.items():
        _worker_nodes.have(name, **given)
    return _worker_nodes


@pytest.fixture(scope="module")
def ear(ros_domain, nodes):
    with contextlib.closing(Ear(ros_domain)) as ear:
        yield ear


@pytest.fixture
def display(request, nodes, ear):
    """The ear, with the nodes of the module as they are after their start: see Ear.as_started."""
    for name, given in request.module.NODES.items():
        nodes.have(name, **given)
    ear.as_started(nodes.running["haptic_driver"].given)
    return ear
