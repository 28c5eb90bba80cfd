# SPDX-License-Identifier: Apache-2.0
"""What a device description may say of its link, and how the bridge's `port` points it elsewhere."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.config_files import ConfigError
from haptic_device.description import load_device, parse
from haptic_device.link import codec, haply, moteus, open_serial, open_udp
from haptic_device.link_registry import LINKS, SERVED, Link
from haptic_device.nodes.bridge import address, contradictions, pointed

AXIS = {"name": "x", "counts_per_unit": 1000.0, "motor_limit": 2.0, "workspace": [-1.0, 1.0], "velocity_limit": 1.0}
AXIS |= {"mass": 0.1, "damping": 1.0}
KNOWN = "loopback, shared_memory, serial, udp, haply, moteus"


def read(link):
    """The link of a description that says this."""
    return parse({"name": "mine", "axes": [AXIS], "link": link}, "mine.yaml").link


@pytest.mark.parametrize(
    ("link", "told"),
    [
        ({"type": "loopback"}, {}),
        ({"type": "shared_memory"}, {}),
        ({"type": "serial", "port": "/dev/a"}, {"baud": 115200, "program": "none"}),
        ({"type": "serial", "port": "/dev/a", "baud": 1200}, {"program": "none"}),
        ({"type": "serial", "port": "/dev/a", "baud": 12_000_000}, {"program": "none"}),
        ({"type": "udp", "port": 1}, {"host": "127.0.0.1", "program": "none"}),
        ({"type": "udp", "port": 65535, "host": "box", "program": "reference"}, {}),
        ({"type": "haply", "port": "/dev/a", "generation": 3}, {"baud": 115200}),
        ({"type": "moteus", "port": "/dev/a", "ids": [1]}, {"baud": 115200, "watchdog": 0.1}),
    ],
)
def test_a_link_is_kept_with_what_it_does_not_say_and_reads_back_as_itself(link, told):
    kept = read(link).model_dump()
    assert kept == link | told
    assert read(kept).model_dump() == kept


@pytest.mark.parametrize(
    ("link", "sentence"),
    [
        ("serial", "link is 'serial': it should be a mapping such as {type: serial, port: /dev/ttyACM0}, not 'serial'"),
        ({}, f"link: type is missing; write one of {KNOWN}"),
        ({"port": "/dev/a"}, f"link: type is missing; write one of {KNOWN}"),
        ({"type": "usb"}, f"link: type is 'usb'; it should be one of {KNOWN}"),
        ({"type": ["serial"]}, f"link: type is ['serial']; it should be one of {KNOWN}"),
        ({"type": "loopback", "port": 1}, "link: type loopback has no key 'port'"),
        ({"type": "shared_memory", "baud": 1}, "link: type shared_memory has no key 'baud'"),
        ({"type": "serial"}, "link: port is missing; add it"),
        ({"type": "serial", "port": 3}, "link: port is 3: it should be text"),
        ({"type": "serial", "port": "a", "speed": 1}, "link: has no key 'speed'; known here are port, baud, program"),
        (
            {"type": "serial", "port": "a", "baud": 1199},
            "link: baud is 1199: it should be greater than or equal to 1200 bit/s",
        ),
        (
            {"type": "serial", "port": "a", "baud": 12_000_001},
            "link: baud is 12000001: it should be less than or equal to 1.2e+07 bit/s",
        ),
        ({"type": "serial", "port": "a", "baud": 9600.0}, "link: baud is 9600.0: it should be a whole number"),
        ({"type": "serial", "port": "a", "baud": True}, "link: baud is True: it should be a whole number"),
        ({"type": "udp"}, "link: port is missing; add it"),
        ({"type": "udp", "port": 0}, "link: port is 0: it should be greater than or equal to 1"),
        ({"type": "udp", "port": 65536}, "link: port is 65536: it should be less than or equal to 65535"),
        ({"type": "udp", "port": "5005"}, "link: port is '5005': it should be a whole number"),
        ({"type": "udp", "port": 5, "baud": 1}, "link: has no key 'baud'; known here are host, port, program"),
        (
            {"type": "udp", "port": 5, "program": "other"},
            "link: program is 'other': it should be 'none' or 'reference'",
        ),
    ],
)
def test_what_is_no_link_is_refused_in_a_sentence(link, sentence):
    with pytest.raises(ConfigError) as refused:
        read(link)
    assert str(refused.value) == f"mine.yaml: {sentence}"


@pytest.mark.parametrize(("kind", "key"), [("serial", "port"), ("udp", "host")])
def test_a_port_or_host_without_a_letter_is_refused(kind, key):
    with pytest.raises(ConfigError, match=rf"link: {key} is ''"):
        read({"type": kind, "port": 5, key: ""})


@given(st.dictionaries(st.text(max_size=8), st.none() | st.integers() | st.text(max_size=8), max_size=3))
def test_no_mapping_is_another_error_than_a_refusal(link):
    try:
        read(link)
    except ConfigError as refused:
        assert "\n" not in str(refused)
    else:
        assert link["type"] in (*SERVED, *LINKS)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("reference_pty", open_serial),
        ("reference_udp", open_udp),
        ("haply_2diy", haply),
        ("moteus_knob", moteus),
    ],
)
def test_each_shipped_device_on_a_line_finds_its_module(name, kind):
    device = load_device(name)
    assert device.link.module is kind and isinstance(device.link.options, kind.Options)


# where the bridge's `port` points


SERIAL, UDP = open_serial.Options(port="/dev/ttyACM0", baud=9600), open_udp.Options(host="box", port=5005)


def test_without_a_port_the_description_counts():
    assert pointed(SERIAL, "") is SERIAL and pointed(UDP, "") is UDP
    assert address(SERIAL) == "/dev/ttyACM0" and address(UDP) == "UDP box:5005"


def test_a_path_takes_the_place_of_a_serial_port_and_nothing_else_changes():
    there = pointed(SERIAL, "/tmp/my line")
    assert (there.port, there.baud, address(there)) == ("/tmp/my line", 9600, "/tmp/my line")
    assert pointed(SERIAL, "5006").port == "5006"


@pytest.mark.parametrize(
    ("port", "where"),
    [
        ("1", ("box", 1)),
        ("65535", ("box", 65535)),
        ("10.0.0.2:5006", ("10.0.0.2", 5006)),
        (":5006", ("box", 5006)),
        ("::1:5006", ("::1", 5006)),
    ],
)
def test_a_number_or_host_and_number_take_the_place_of_a_udp_address(port, where):
    there = pointed(UDP, port)
    assert (there.host, there.port) == where
    assert address(there) == "UDP {}:{}".format(*where)


@pytest.mark.parametrize("port", ["0", "65536", "-1", "1.5", "box", "box:", "box:0", "box:65536", "/dev/ttyACM0", " 5"])
def test_what_is_no_udp_port_is_refused_with_the_limits(port):
    with pytest.raises(ValueError) as refused:
        pointed(UDP, port)
    assert str(refused.value) == (
        f"port is {port!r}; of a UDP device it should be a number from 1 to 65535, or HOST:NUMBER"
    )


@given(st.text(max_size=12))
def test_any_text_is_a_udp_port_or_refused(port):
    try:
        there = pointed(UDP, port)
    except ValueError as refused:
        assert "\n" not in str(refused)
    else:
        assert 1 <= there.port <= 65535 and there.host


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


@pytest.mark.parametrize(
    ("text", "said"), [(None, "No module named 'not_there'"), ("", "has no Options, codec, compiled")]
)
def test_a_link_whose_file_is_not_there_or_is_not_whole_is_refused_in_one_sentence(monkeypatch, tmp_path, text, said):
    if text is not None:
        (tmp_path / "not_there.py").write_text(text)
        monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "not_there", raising=False)
    monkeypatch.setitem(LINKS, "mine", "not_there")
    with pytest.raises(ValueError, match=said) as refused:
        Link.model_validate({"type": "mine", "port": "/dev/null"})
    assert "type mine" in str(refused.value)
