# SPDX-License-Identifier: Apache-2.0
"""The page without nodes: two layers, what it remembers, where things stand, colours, explanations, its link."""

import itertools
import socket

import pytest
from conftest import Tab
from made_up_viewer import STATUS, VALUES, MadeUpViewer

from haptic_display.page import settings

pytestmark = pytest.mark.timeout(300)

SIMPLE = ("state", "estop", "scene", "force", "strip_force", "scene_name", "walls", "tuning", "recording")
EXPERT = ("torque", "stretch", "strip_energy", "strip_age", "method_name", "sliders", "health", "study", "sharing")
WITHIN = ("add_wall", "gains", "record")  # panels that begin folded
DESK, PHONE = (1400, 900), (390, 844)
SIZES = DESK, (1280, 720), (900, 600), PHONE, (640, 360), (320, 180)  # the last two: 1280x720 at 200 % and 400 %
CONTROLS = "button, select, input, summary, a"
GIVEN = "#fault *, #sliders *, .fold"  # have words of their own
TASK = {"state": "paused", "share": 0.5, "slow": False}
BAGS = [{"name": name, "seconds": 2.0, "size": 1e6} for name in ("one", "two")]
SAVED = {"state": "saved", "seconds": 0.0, "bag": "/somewhere/one", "name": "one", "bags": BAGS}
RANGES = {
    "coupling.stiffness": [0.0, 2300.0],
    "coupling.damping": None,
    "wall.stiffness": [[0.0, 1500.0], None],
    "wall.damping": [[0.1, 0.4], [0.0, 1e9]],
}
JARGON = ("passive", "passivity", "coupling", "theta", "p99", "exchange", "sample")
MEASURED = {"passivity_margin": "2.4", "passivity_margin_theta": "0.0008", "window_s": "5.0", "missed": "3"}
MEASURED |= {f"lateness_us_{share}": "151" for share in ("p50", "p99", "p999", "max")} | {"age_ms_p99": "2.3"}
MEASURED |= {"exchange_method": "pspm", "exchange_answered": "9998", "exchange_sent": "10000", "ticks": "40000"}
DRIVER = {"state": "engaged", "fault": "", "withheld": "", "age_ms_p50": "1.1"} | MEASURED
NODES = {
    "haptic_recorder": {"level": 0, "message": "idle", "values": {}},
    "haptic_simulation": {"level": 1, "message": "Simulation paused once: handle data was late.", "values": {}},
}
ENGAGED = {"level": 0, "message": "engaged", "values": DRIVER}
NOT_FELT = {"words": "tool not felt", "todo": "Tool not felt. Lead the handle to the tool."}
LESS = {"words": "less force", "todo": "Less force: more force is wanted than the motor holds. Push less."}
STOPPED = {"title": "Emergency stop", "cause": "A person pressed stop.", "first": "", "button": "Reset and engage"}
FAULT = {"level": 2, "message": "fault: estop", "values": {**DRIVER, "state": "fault", "fault": "estop"}}
WALLS = {"normals": [0.0, 1.0, 1.0, 0.0], "offsets": [-0.03, -0.08], "stiffness": [100.0, 50.0], "damping": [0.1, 0.1]}
ONE = {"unit": "ms", "low": 0, "high": 200}
OFFER = {"exchange.method": {"value": "pspm", "choices": ["direct", "pspm", "local"]}, "delay": {"value": 0.0, **ONE}}


PUSHING = {
    "contacts": [[0, 0, 0.0101, -0.001, 1, 0, 2.0, 1.0, 0]],
    "force": [1.2, 4.8, 0.01],
    "felt": [1.1, 4.9, 0.01],
    "energy": [0.002, -0.001],
}


@pytest.fixture(scope="module")
def served():
    served = MadeUpViewer()
    yield served
    served.close()


@pytest.fixture
def opened(chromium, served):
    """opened(size, expert=, looking=, **context) is a page that shows the state; scripts: run before it."""
    engaged(served)
    tabs = []

    def open_page(size=DESK, expert=False, looking=False, scripts=(), **given):
        tab = Tab(chromium, *size, expert=expert, **given)
        tabs.append(tab)
        for script in scripts:
            tab.page.add_init_script(script)
        tab.page.goto(served.looking if looking else served.address)
        tab.until_text("state", "^engaged$")
        tab.until(f"document.body.classList.contains('looking') === {str(looking).lower()}")
        return tab

    yield open_page
    for tab in tabs:
        assert tab.complaints == []
        tab.page.close()


def engaged(served):
    """A display without walls that pushes back."""
    served.tell("status", status())
    served.tell("values", values())
    served.show_scene("peg_in_hole", **PUSHING)


def status(driver=ENGAGED, **told):
    """Of all nodes, with this of the driver; told: what the viewer says beside."""
    return STATUS | {"nodes": NODES | {"haptic_driver": driver}} | told


def values(**walls):
    """The driver's and the simulation's, with these walls."""
    live = {name: parameter.default for name, parameter in settings.LIVE.items()}
    live |= {f"wall.{name}": value for name, value in walls.items()} | {"exchange.method": "pspm"}
    both = {"haptic_driver": live, "haptic_simulation": {"scene": "peg_in_hole", "method": "auto"}}
    return VALUES | {"values": both, "offer": OFFER}


def visible(tab, names):
    return [name for name in names if tab.page.is_visible(f"#{name}")]


def fail(tab, served):
    served.tell("status", status(FAULT))
    tab.until("document.getElementById('state').dataset.level === 'bad'")


def reloaded(tab):
    tab.page.reload()
    tab.until_text("state", "^engaged$")


def test_the_page_is_simple_until_expert_is_pressed_and_layer_colours_and_folds_stay_after_a_reload(opened, served):
    tab = opened(color_scheme="dark")
    assert visible(tab, SIMPLE + EXPERT) == list(SIMPLE)
    for theme in ("dark", "light", "dark"):  # as the system has it, light, dark
        reloaded(tab)
        assert tab.page.get_attribute("html", "data-theme") == theme
        tab.page.click("#theme")
    tab.page.click("#layer")
    lists = "[...document.querySelectorAll('#sliders details')].map((one) => one.open).join()"
    tab.until("document.querySelector('#sliders details')")
    for fold in ("#recording .fold", "#words .fold", "#task .fold"):
        tab.page.click(fold)
    for which in ("first", "last"):
        tab.page.click(f"#sliders details:{which}-child summary")
    now, folded = tab.page.evaluate(lists), ("record", "explained", "scene_name", "goal")
    for _ in range(2):
        assert set(EXPERT) - set(visible(tab, EXPERT)) == {"method_name"} and visible(tab, folded) == ["explained"]
        assert tab.page.get_attribute("#layer", "aria-pressed") == "true"
        assert tab.page.get_attribute("#recording .fold", "aria-expanded") == "false"
        reloaded(tab)
        tab.until(f"{lists} === {now!r}")
    tab.page.click("#task .fold")
    served.show_scene("drive_nail")
    tab.until("document.getElementById('goal').textContent.includes('nail')")
    assert tab.page.is_visible("#goal"), "the card that was folded opens again though its title is another scene's"


def test_a_browser_that_remembers_nonsense_or_nothing_shows_the_simple_page(opened):
    for script in (
        "for (const name of ['layer', 'theme', 'folds']) localStorage.setItem(name, '[1, {\"');",
        'localStorage.setItem(\'folds\', \'{"recording": 0, "scenery": "x", "words": null}\');',
        "Object.defineProperty(window, 'localStorage', { get() { throw new Error('blocked'); } });",
    ):
        tab = opened(scripts=[script])
        assert visible(tab, SIMPLE + EXPERT + WITHIN) == list(SIMPLE), script
        tab.shot("first_view")
        tab.page.click("#layer")
        assert set(EXPERT) - set(visible(tab, EXPERT)) == {"sliders"}


def test_a_fault_is_in_the_title_reset_is_there_and_who_only_looks_on_reads_who_may_press(opened, served):
    tab, looking = opened(), opened(looking=True)
    assert tab.page.title() == "engaged — haptic_display"
    assert not tab.page.is_visible("[data-service=reset]") and not tab.page.is_visible("#fault")
    fail(tab, served)
    assert tab.page.title() == f"{tab.text('state')} — haptic_display" and "fault" in tab.page.title()
    assert tab.page.is_visible("[data-service=reset]") or tab.page.is_visible("#fault button")
    served.tell("status", status(FAULT, trouble=STOPPED))
    for page in (tab, looking):
        page.until_text("fault_title", "^Emergency stop$")
        assert page.page.is_visible("#fault_elsewhere") == (page is looking) != page.page.is_visible("#fault_button")
    assert '"Reset and engage"' in looking.text("fault_elsewhere")


def in_both_layers(tab, sizes):
    """Each size, in the simple layer and in that of experts."""
    for width, height in sizes:
        tab.page.set_viewport_size({"width": width, "height": height})
        for _ in range(2):
            tab.page.evaluate("document.getElementById('layer').click()")
            yield width, height


def test_at_every_size_e_stop_is_in_view_nothing_is_cut_covered_or_smaller_than_a_finger(opened, served):
    tab = opened()
    served.tell("values", values(**WALLS))
    fail(tab, served)
    tab.until("document.querySelectorAll('#sliders .walls input, #walls input').length > 0")
    for opens in ("false", "true"):
        tab.page.evaluate(f"document.querySelectorAll('details').forEach((one) => (one.open = {opens}))")
        for width, height in in_both_layers(tab, SIZES):
            for place in (0, 1e6):
                tab.page.evaluate(f"window.scrollTo(0, {place})")
                box = tab.page.locator("#estop").bounding_box()
                x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
                assert min(box["x"], box["y"], width - x - box["width"] / 2, height - y - box["height"] / 2) >= 0
                assert tab.page.evaluate(f"document.elementFromPoint({x}, {y}).closest('#estop') !== null")
            assert cut(tab) == small(tab) == []
            assert tab.page.evaluate("document.documentElement.scrollWidth") <= width
            for one, other in itertools.combinations(tab.page.evaluate(BOXES), 2):
                assert apart(one, other, "x", "width") or apart(one, other, "y", "height"), (width, one, other)


# of one moment: the page goes on laying itself out between two questions
BOXES = """['readout', 'results', 'tools', 'keys'].map((name) => document.getElementById(name))
    .filter((one) => one.checkVisibility()).map((one) => one.getBoundingClientRect().toJSON())"""


def cut(tab):
    """What is wider inside than outside."""
    return tab.page.evaluate("""[...document.querySelectorAll('body, body *')]
        .filter((one) => one.checkVisibility() && !one.matches('h1, input, select, option, .hidden, #wall_dots'))
        .filter((one) => one.scrollWidth > one.clientWidth + 1 && getComputedStyle(one).display !== 'inline')
        .map((one) => one.id || one.className || one.textContent)""")


def small(tab):
    """What can be pressed, smaller than a finger; a label belongs to its control."""
    return tab.page.evaluate(f"""[...document.querySelectorAll({CONTROLS!r})].filter((one) => one.checkVisibility())
        .map((one) => {{
            const boxes = [one, ...(one.labels ?? [])].map((part) => part.getBoundingClientRect());
            const size = (low, high) => Math.max(...boxes.map((b) => b[high])) - Math.min(...boxes.map((b) => b[low]));
            return [one.id || one.textContent, size('left', 'right'), size('top', 'bottom')];
        }}).filter(([, width, height]) => width < 43.9 || height < 43.9)""")


def apart(one, other, at, long):
    return one[at] >= other[at] + other[long] or other[at] >= one[at] + one[long]


def test_the_line_at_the_foot_explains_what_is_pointed_at_and_what_has_the_focus(opened):
    tab = opened(expert=True)
    said = "getComputedStyle(document.getElementById('about'), '::before').content"
    assert tab.text("about") == "" and tab.text("keys") in tab.page.evaluate(said)
    tab.page.hover(".gauge:has(#margin)")
    assert "own friction" in tab.text("about") and "shaking by itself" in tab.text("about")
    tab.page.hover("h1")
    assert tab.text("about") == ""
    tab.page.focus("#estop")
    assert "Cuts all force at once" in tab.text("about")
    tab.page.hover("label[for=tone]")
    assert tab.text("about").startswith("Tone: ")
    tab.page.hover("h1")
    assert "Cuts all force at once" in tab.text("about"), "what has the focus is explained while nothing is pointed at"


@pytest.mark.parametrize("expert", (False, True), ids=("simple", "expert"))
def test_no_banner_moves_the_plane_at_any_width(opened, served, expert):
    tab = opened(expert=expert)
    outside = STOPPED | {"title": "Handle outside the workspace", "first": "Lead the handle back into the workspace."}
    for width, height in (DESK, (900, 600), PHONE, (320, 640)):
        tab.page.set_viewport_size({"width": width, "height": height})
        before = tab.page.locator("#scene").bounding_box()
        for told, level, leads in (
            (status(FAULT, trouble=outside), "bad", "none"),
            (status(FAULT), "bad", "other"),
            (status(unfelt=LESS), "warn", "none"),
            (STATUS, "bad", "none"),
            (status(), "good", "none"),
        ):
            served.tell("status", told)
            served.tell("leader", leads)
            tab.until(f"document.getElementById('state').dataset.level === {level!r}")
            tab.until(f"document.getElementById('leader').hidden === {str(leads == 'none').lower()}")
            assert tab.page.locator("#scene").bounding_box() == before, (width, told)


def test_on_a_phone_what_has_the_focus_is_explained_and_neither_words_nor_a_lack_of_force_hide_or_move_the_plane(
    opened, served
):
    tab = opened(PHONE, has_touch=True, is_mobile=True)
    tab.until("document.getElementById('task_title').textContent === 'Put the peg into its hole'")
    before = tab.page.locator("#scene").bounding_box()
    served.tell("status", status(unfelt=LESS))
    tab.until("!document.getElementById('withheld').hidden")
    assert tab.page.locator("#scene").bounding_box() == before
    served.tell("status", status())
    tab.until("document.getElementById('withheld').hidden")
    tab.page.evaluate("document.getElementById('record').focus({preventScroll: true})")
    tab.until_text("about", "^Record: ")
    assert tab.page.is_visible("#about")
    x, y = tab.middle()
    screen = tab.page.context.new_cdp_session(tab.page)
    screen.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    tab.until("document.getElementById('scene').classList.contains('held')")
    assert not tab.page.is_visible("#about")
    screen.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_every_control_and_figure_has_a_description_in_words_and_all_stand_in_one_list(opened, served):
    tab = opened(expert=True)
    served.tell("values", values(**WALLS))
    served.tell("status", status(guide=TASK))
    served.tell("recordings", SAVED)
    served.tell("leader", "other")
    tab.until("document.getElementById('wall_2_damping') && document.querySelectorAll('#bags a').length === 2")
    tab.until("!document.getElementById('leader').hidden && !document.getElementById('guide').hidden")
    tab.page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    own = "id.startsWith('about_') && document.getElementById(id)"
    explained = f"{CONTROLS}, #readout > div, figure, .gauge"
    undescribed = tab.page.evaluate(f"""[...document.querySelectorAll({explained!r})]
        .filter((one) => one.checkVisibility() && !one.matches({GIVEN!r}))
        .filter((one) => !one.getAttribute('aria-describedby')?.split(' ').some((id) => {own}))
        .map((one) => one.id || one.outerHTML)""")
    assert undescribed == []
    tab.page.focus("#words .fold")
    tab.page.keyboard.press("Enter")
    count = "[...document.querySelectorAll('#explained > div')].filter((one) => one.checkVisibility()).length"
    everything = tab.page.evaluate(count)
    tab.page.click("#layer")
    assert 10 < tab.page.evaluate(count) < everything
    served.tell("recordings", SAVED | {"state": "ready", "bag": "", "name": "", "bags": []})
    served.tell("leader", "none")


def test_the_simple_layer_says_what_stays_stable_in_words_of_everybody(opened, served):
    tab = opened()
    served.tell("values", values(**WALLS) | {"passive": RANGES})
    tab.until_text("gain_coupling_stiffness_passive", "^stable up to 2300 N.m$")
    assert tab.text("gain_coupling_damping_passive") == "no value is stable: lower other gains"
    tab.until_text("wall_1_stiffness_passive", "^stable up to 1500 N.m$")
    tab.page.click("#words .fold")
    simple = tab.page.inner_text("body").lower()
    assert "stable up to" in simple and [word for word in JARGON if word in simple] == []


def test_the_keyboard_reaches_what_drives_first_then_the_plane_then_the_panels(opened):
    tab = opened()
    reached = []
    for _ in range(6):
        tab.page.keyboard.press("Tab")
        reached.append(tab.page.evaluate("document.activeElement.dataset.service ?? document.activeElement.id"))
    assert reached == ["enable", "disable", "layer", "theme", "estop", "scene"]


def colour(tab, selector, what):
    return tab.page.evaluate(f"getComputedStyle(document.querySelector({selector!r}))[{what!r}]")


def test_with_forced_colours_everything_is_told_by_the_systems_own_and_who_wants_less_motion_gets_none(opened, served):
    tab = opened(expert=True, color_scheme="dark", forced_colors="active", reduced_motion="reduce")
    tab.page.evaluate("document.querySelector('#state').style.transition = 'color 1s'")
    assert colour(tab, "#state", "transitionDuration") == "0s"
    tab.page.evaluate("document.body.insertAdjacentHTML('beforeend', '<p id=probe>')")
    tab.page.evaluate("Object.assign(probe.style, { forcedColorAdjust: 'none', background: 'Canvas' })")
    canvas = colour(tab, "#probe", "backgroundColor")
    assert all(colour(tab, selector, "backgroundColor") != canvas for selector in ("#estop", "#layer", "#margin i"))
    fail(tab, served)
    corner = "[...document.querySelector('#strip_force').getContext('2d').getImageData(1, 1, 1, 1).data]"
    tab.until(f"'rgb(' + {corner}.slice(0, 3).join(', ') + ')' === {canvas!r}")


@pytest.mark.parametrize("size", (DESK, PHONE), ids=("desk", "phone"))
def test_axe_finds_nothing_moderate_or_worse_in_either_layer_with_a_fault_with_walls_and_all_pressed(
    opened, served, size
):
    tab, found = opened(size), {}
    served.tell("status", status(unfelt=NOT_FELT))
    tab.until("document.getElementById('state').dataset.level === 'warn'")
    tab.page.click("#words .fold")
    for step in ("simple", "expert with a fault"):
        for scheme in ("light", "dark", "forced"):
            forced = "active" if scheme == "forced" else "none"
            tab.page.emulate_media(color_scheme="light" if scheme == "light" else "dark", forced_colors=forced)
            found[f"{step}, {scheme}"] = tab.harm()
        tab.shot(f"{step.replace(' ', '_')}_{size[0]}")
        tab.page.click("#layer")
        served.tell("values", values(**WALLS))
        tab.until("document.querySelectorAll('#sliders .walls input, #walls input').length > 0")
        fail(tab, served)
        tab.page.evaluate("document.querySelectorAll('[aria-pressed]').forEach((one) => (one.ariaPressed = 'true'))")
    assert found == dict.fromkeys(found, [])


def test_a_page_whose_viewer_was_started_anew_goes_on_by_itself_with_the_same_link(chromium, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    first, tab = MadeUpViewer(port, status=status()), Tab(chromium)
    tab.page.goto(first.address)
    tab.until_text("state", "^engaged$")
    first.close()
    tab.until_text("state", "no viewer")
    again = MadeUpViewer(port, status=status())
    tab.until_text("state", "^engaged$")
    assert again.address == first.address and not tab.page.is_visible("#banner")
    tab.page.close()
    again.close()
