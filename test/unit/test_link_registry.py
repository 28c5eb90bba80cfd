# SPDX-License-Identifier: Apache-2.0
"""What a device description may say of its link, and how the bridge's `port` points it elsewhere."""

import importlib
import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from haptic_device.config.description import load_device, parse
from haptic_device.config.files import ConfigError
from haptic_device.config.link_registry import LINKS, SERVED, Link
from haptic_device.link import codec, open_serial, open_udp
from haptic_device.nodes.bridge import address, contradictions, pointed

AXIS = {"name": "x", "counts_per_unit": 1000.0, "motor_limit": 2.0, "workspace": [-1.0, 1.0], "velocity_limit": 1.0}
AXIS |= {"mass": 0.1, "damping": 1.0}


def read(link):
    """The link of a description that says this."""
    return parse({"name": "mine", "axes": [AXIS], "link": link}, "mine.yaml").link


def test_a_link_is_kept_with_what_it_does_not_say_and_reads_back_as_itself():
    for link, told in (
        ({"type": "loopback"}, {}),
        ({"type": "shared_memory"}, {}),
        ({"type": "serial", "port": "/dev/a"}, {"baud": 115200, "program": "none"}),
        ({"type": "udp", "port": 1}, {"host": "127.0.0.1", "program": "none"}),
        ({"type": "haply", "port": "/dev/a", "generation": 3}, {"baud": 115200}),
        ({"type": "moteus", "port": "/dev/a", "ids": [1]}, {"baud": 115200, "watchdog": 0.1}),
    ):
        kept = read(link).model_dump()
        assert kept == link | told
        assert read(kept).model_dump() == kept


@given(st.dictionaries(st.text(max_size=8), st.none() | st.integers() | st.text(max_size=8), max_size=3))
def test_no_mapping_is_another_error_than_a_refusal(link):
    try:
        read(link)
    except ConfigError as refused:
        assert "\n" not in str(refused)
    else:
        assert link["type"] in (*SERVED, *LINKS)


SERIAL, UDP = open_serial.Options(port="/dev/ttyACM0", baud=9600), open_udp.Options(host="box", port=5005)


def test_the_bridges_port_takes_the_place_of_a_serial_port_and_nothing_else_changes():
    there = pointed(SERIAL, "/tmp/my line")
    assert (there.port, there.baud, address(there)) == ("/tmp/my line", 9600, "/tmp/my line")
    assert pointed(SERIAL, "5006").port == "5006"
    assert pointed(SERIAL, "") is SERIAL
    assert address(SERIAL) == "/dev/ttyACM0"


def test_a_number_or_host_and_number_take_the_place_of_a_udp_address():
    for port, host, number in (
        ("1", "box", 1),
        ("65535", "box", 65535),
        ("10.0.0.2:5006", "10.0.0.2", 5006),
        (":5006", "box", 5006),
        ("::1:5006", "::1", 5006),
        ("", "box", 5005),
    ):
        there = pointed(UDP, port)
        assert (there.host, there.port, address(there)) == (host, number, f"UDP {host}:{number}")


@given(st.text(max_size=12))
@example("0")
@example("65536")
@example("box:65536")
@example("-1")
@example("1.5")
@example("box:")
@example(" 5")
def test_any_text_is_a_udp_port_or_refused_with_the_limits(port):
    try:
        there = pointed(UDP, port)
    except ValueError as refused:
        assert str(refused) == (
            f"port is {port!r}; of a UDP device it should be a number from 1 to 65535, or HOST:NUMBER"
        )
    else:
        assert 1 <= there.port <= 65535
        assert there.host


def test_a_device_that_contradicts_its_description_is_told_in_what():
    device, state = load_device("reference_udp"), np.zeros(codec.OWN, np.int64)
    state[codec.AXES], told = 3, state[codec.TOLD : codec.TOLD + 6].view(np.float64)
    told[:] = 200000.0, 200000.0, 40000.0, 15.0, 15.0, 1.0
    assert list(contradictions(state, device)) == []
    told[:] = 0.0  # it does not say
    assert list(contradictions(state, device)) == []
    told[:] = 200000.0, 200300.0, 40000.0, 14.9, 16.0, 1.0
    assert list(contradictions(state, device)) == [
        "axis x takes motor values up to 14.9, its description gives up to 15",
        "axis y has 200300 counts per unit, its description 200000",
    ]
    state[codec.AXES] = 2
    assert next(contradictions(state, device)) == "the device has 2 axes, its description 3"
    told[:] = 20000.0, 10000.0, 0.0, 1.5, 1.0, 0.0
    assert list(contradictions(state, load_device("serial_2r"))) == [  # motors of joints: counts/rad, N m
        "joint elbow has 10000 counts per unit, its description 20000",
        "joint elbow takes motor values up to 1, its description gives up to 1.5",
    ]


def test_a_link_whose_file_is_not_there_or_is_not_whole_is_refused_in_one_sentence(monkeypatch, tmp_path):
    monkeypatch.setitem(LINKS, "mine", "not_there")
    monkeypatch.syspath_prepend(tmp_path)
    for text, said in ((None, "No module named 'not_there'"), ("", "has no Options, codec, compiled")):
        if text is not None:
            (tmp_path / "not_there.py").write_text(text)
            importlib.invalidate_caches()
        monkeypatch.delitem(sys.modules, "not_there", raising=False)
        with pytest.raises(ValueError, match=said) as refused:
            Link.model_validate({"type": "mine", "port": "/dev/null"})
        assert "type mine" in str(refused.value)
