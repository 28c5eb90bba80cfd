# SPDX-License-Identifier: Apache-2.0
"""How long an e-stop waits beside load: until the driver has answered that the motor is at zero, median and worst.

Beside requests to set many parameters, asked for as a service; and on a page that sends many messages itself.
"""

import asyncio
import gc
import json
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import aiohttp
import typer
from ear import Ear
from live_nodes import Nodes
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from haptic_sim.supervision.domain import isolated_domain

ENTRIES = (0, 100, 1000, 3000)  # of one request
RATES = (0, 1000, 5000)  # messages a second of one page
LEAD = 1.0  # [s] for which a page sends before its e-stop
STOP = '{"do": "trigger", "service": "estop"}'
AIM = '{"do": "aim", "x": 0.0}'


def said(load, took):
    return f"| {load} | {1e3 * statistics.median(took):.1f} | {1e3 * max(took):.1f} |"


def beside_parameters(ear, entries, runs):
    """Times [s] from a call to its answer, right behind a request of so many entries."""
    setter = ear.node.create_client(SetParameters, "haptic_driver/set_parameters")
    stopper = ear.node.create_client(Trigger, "haptic_driver/estop")
    ear.until(lambda: setter.service_is_ready() and stopper.service_is_ready(), "the services")
    one, took = Parameter("fault.duty", value=1.0).to_parameter_msg(), []
    for _ in range(runs):
        ear.cleared()
        ear.engaged()
        load = setter.call_async(SetParameters.Request(parameters=[one] * entries))
        began = time.monotonic()
        stop = stopper.call_async(Trigger.Request())
        ear.until(stop.done, "the e-stop's answer")
        took.append(time.monotonic() - began)
        assert stop.result().success, stop.result().message
        ear.until(load.done, "the request's answer")
    return took


async def beside_messages(ear, address, rate, runs):
    """Times [s] from a page's e-stop to the answer on the page, which goes on to send so many messages a second."""
    took, origin = [], "/".join(address.split("/")[:3])
    socket = address.replace("http", "ws", 1) + "socket"
    async with aiohttp.ClientSession() as session:
        while len(took) < runs:
            ear.cleared()
            ear.engaged()
            async with session.ws_connect(socket, headers={"Origin": origin}, max_msg_size=0) as page:
                answered = asyncio.create_task(_answer(page))
                began, sent, stopped = time.monotonic(), 0, 0.0
                while not answered.done():
                    if not stopped and time.monotonic() > began + LEAD:
                        stopped = time.monotonic()
                        await page.send_str(STOP)
                    for _ in range(min(50, int((time.monotonic() - began) * rate) - sent)):
                        await page.send_str(AIM)
                        sent += 1
                    await asyncio.sleep(0.001)
                if answered.result():  # else the viewer had not met the driver yet
                    took.append(answered.result() - stopped)
    return took


async def _answer(page):
    """When the answer to the e-stop has come, 0 for a refusal; frames are seen meanwhile, as a page does."""
    async for message in page:
        news = json.loads(message.data)
        if news["kind"] == "frame":
            await page.send_str(json.dumps({"do": "seen", "frame": news["number"]}))
        elif news["kind"].startswith("answer ") and news["content"]["to"].get("service") == "estop":
            return time.monotonic() if news["content"]["done"] else 0.0
    raise ConnectionError("the viewer closed the page's connection")


def main(runs: Annotated[int, typer.Option(min=1, help="Of each load.")] = 50) -> None:
    """Median and worst time from an e-stop to its answer."""
    with tempfile.TemporaryDirectory() as folder, isolated_domain(Path(folder)) as domain, Nodes(Path(folder)) as nodes:
        ear = Ear(domain)
        nodes.start("haptic_loopback", motion__name="follow")
        nodes.start("haptic_driver", engage__time=0.05)
        ear.until(lambda: ear.truths and ear.said.get("haptic_driver"), "driver and device")
        gc.freeze()  # what is timed is the driver, not a collection here
        print(f"e-stop to its answer, {runs} runs each\n| beside | median ms | worst ms |\n|---|---|---|")
        for entries in ENTRIES:
            print(said(f"a request of {entries} parameters", beside_parameters(ear, entries, runs)), flush=True)
        view = subprocess.Popen(
            [sys.executable, "-m", "haptic_sim.cli.main", "view"], stdout=subprocess.PIPE, text=True
        )
        try:
            address = re.search(r"http://\S+", view.stdout.readline()).group()
            for rate in RATES:
                took = asyncio.run(beside_messages(ear, address, rate, runs))
                print(said(f"{rate} messages a second of its page", took), flush=True)
        finally:
            view.terminate()
            view.wait(20)
        ear.close()
