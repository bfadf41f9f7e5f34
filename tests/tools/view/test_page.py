"""The page in a real browser: what it draws is where the node says, and what is turned on it reaches the node."""

import colorsys
import io
import math
import re
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from PIL import Image
from smartmesh_msgs.msg import BodyDescription, ColliderPatch
from smartmesh_msgs.srv import RemoveBody

from smartmesh_ros.tools.testing import TIMEOUT, Probe, Process
from smartmesh_ros.tools.view.camera import Camera, Lens
from smartmesh_ros.tools.view.looks import BODY_COLOURS, PatchLook
from tests.node import shared
from tests.tools.view.test_camera import places_in

CELL, SIDE = 0.1, 12.0  # of the map [m]: flat where x < 0, small waves where x > 0
WIDTH, HEIGHT = 860, 560
CAMERA = Camera(np.array([0.0, -5.0, 7.0]), np.zeros(3))
FIELD_OF_VIEW = math.radians(75.0)
# Four frames a second: drawn on the processor, as many as there can be take a core.
FEWER_FRAMES = """
window.requestAnimationFrame = draw => setTimeout(() => draw(performance.now()), 250);
window.cancelAnimationFrame = clearTimeout;
"""
PURPLE, ORANGE = BODY_COLOURS[BodyDescription.BOX], PatchLook.SAMPLES.colour  # of boxes, and of patches of samples
# Where boxes stand: on flat ground, and on waves. Far from both there is only ground.
FLAT, WAVES, BARE = (-2.0, 0.0), (1.5, 0.0), (-1.0, 2.5)


@pytest.fixture(scope="module")
def probe(domain: int) -> Iterator[Probe]:
    """A probe of a node, which publishes no more than a page shows where each frame is drawn on the processor."""
    parameters = {"physics.sleep": False, "publish.patches": 5.0, "publish.body_states": 10.0}
    with Probe() as made, made.running("terrain_collider", parameters):
        yield made


@pytest.fixture(scope="module")
def url(probe: Probe) -> Iterator[str]:
    """The address of a view of that node, which has a map and two boxes."""
    x = np.linspace(-SIDE / 2, SIDE / 2, round(SIDE / CELL) + 1)
    heights = np.tile(np.where(x > 0.5, 0.05 * np.sin(8.0 * x), 0.0), (len(x), 1))
    with Process("view", arguments=["--port", "0"]) as view:
        maps = probe.publishers["heightmap"]
        probe.wait_for(lambda: "shown at" in view.output and maps.get_subscription_count() == 2, watch=view)
        probe.publish_map(heights, resolution=CELL, origin=(-SIDE / 2, -SIDE / 2, 0.0))
        spawn(probe, "flat", FLAT)
        spawn(probe, "waves", WAVES)
        [address] = re.findall(r"shown at (\S+)", view.output)
        yield address
        assert view.stop(signal.SIGINT) == 0, view.output


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A Chromium without a window."""
    pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    from scripts.browser import FLAGS, VARIABLE, find_browser

    path = find_browser()
    if path is None:
        pytest.skip(f"no Chromium is installed (Debian: apt install chromium), and {VARIABLE} names none")
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=path, args=FLAGS)
        yield running
        running.close()


def open_page(browser: Any, url: str) -> Any:
    """A page of the browser at an address."""
    opened = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    opened.set_default_timeout(1000 * TIMEOUT)
    opened.add_init_script(FEWER_FRAMES)
    opened.goto(url)
    return opened


@pytest.fixture(scope="module")
def page(browser: Any, url: str) -> Iterator[Any]:
    """The page, looking down on the two places from a known camera."""
    place, target = (",".join(f"{value:g}" for value in vector) for vector in CAMERA)
    opened = open_page(browser, f"{url}/?initialCameraPosition={place}&initialCameraLookAt={target}")
    opened.get_by_text("real-time factor", exact=False).wait_for()  # comes last, and moves what is below it
    yield opened
    opened.close()


def pixel(point: Any) -> tuple[int, int]:
    """Column and row at which the page shows a point (3,) [m]."""
    [(right, up)] = places_in(CAMERA, np.array([point]), Lens(FIELD_OF_VIEW, WIDTH / HEIGHT))
    return round(WIDTH / 2 * (1.0 + right)), round(HEIGHT / 2 * (1.0 - up))


def hues(page: Any) -> np.ndarray:
    """Hue [degrees] of every pixel (rows, columns) of the page; NaN where there is hardly any colour."""
    image = Image.open(io.BytesIO(page.screenshot())).convert("HSV")
    hue, saturation, _ = np.moveaxis(np.asarray(image).astype(float), -1, 0)
    return np.where(saturation > 60, hue * 360.0 / 255.0, np.nan)


def like(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Pixels of about a colour's hue."""
    hue = 360.0 * colorsys.rgb_to_hsv(*(value / 255.0 for value in colour))[0]
    return int((np.abs((picture - hue + 180.0) % 360.0 - 180.0) < 12.0).sum())


def count(picture: np.ndarray, colour: tuple[int, int, int], points: Any, margin: int = 4) -> int:
    """Pixels of about a colour's hue in the rectangle that holds points (n, 3) [m]."""
    places = np.array([pixel(point) for point in np.reshape(points, (-1, 3))])
    (left, top), (right, bottom) = places.min(axis=0) - margin, places.max(axis=0) + margin
    return like(picture[top:bottom, left:right], colour)


def spawn(probe: Probe, name: str, xy: tuple[float, float]) -> None:
    shared.spawn(probe, name, (*xy, 0.3), mass=5.0, shape=shared.box(0.5, 0.5, 0.3))


def position(probe: Probe, name: str) -> Any:
    return probe.wait_for(lambda: shared.position_of(probe, name))


def patch(probe: Probe, name: str) -> tuple[int, np.ndarray]:
    """Kind and vertices (n, 3) [m] of a body's patch."""
    found = [patch for patch in probe.latest("collider_patches").patches if patch.body_id == name]
    return (found[0].kind, np.array([(v.x, v.y, v.z) for v in found[0].mesh.vertices])) if found else (-1, np.empty(0))


def parameter(probe: Probe, name: str) -> Any:
    return shared.values(probe, [name])[name]


def row(page: Any, name: str) -> Any:
    """What stands beside the label of a parameter."""
    return page.locator("label").get_by_text(name, exact=True).locator("xpath=ancestor::div[2]")


def wait(probe: Probe, page: Any, condition: Any) -> Any:
    """Until a condition holds, while the page and the probe go on; its value."""

    def holds() -> Any:
        page.wait_for_timeout(250)
        return condition()

    return probe.wait_for(holds)


def test_patches_and_bodies_are_drawn_where_the_node_says(probe: Probe, page: Any) -> None:
    names = ("flat", "waves")
    for name in names:
        wait(probe, page, lambda name=name: patch(probe, name)[0] == ColliderPatch.HEIGHTFIELD)
    corners = {name: patch(probe, name)[1] for name in names}

    def drawn(colours: np.ndarray) -> bool:
        patches = all(count(colours, ORANGE, corners[name]) > 30 for name in names)
        return patches and all(count(colours, PURPLE, position(probe, name), margin=8) > 30 for name in names)

    seen = wait(probe, page, lambda: [p] if drawn(p := hues(page)) else [])[0]
    for colour in (PURPLE, ORANGE):
        assert count(seen, colour, (*BARE, 0.15), margin=40) == 0, "bare ground"
    with shared.changed(probe, {"physics.sleep": True}):
        wait(probe, page, lambda: all(count(hues(page), PURPLE, position(probe, name), margin=8) < 5 for name in names))
    wait(probe, page, lambda: all(count(hues(page), PURPLE, position(probe, name), margin=8) > 30 for name in names))
    spawn(probe, "later", BARE)
    place = position(probe, "later")
    wait(probe, page, lambda: count(hues(page), PURPLE, place, margin=20) > 30)
    assert probe.call("remove_body", RemoveBody, id="later").success
    wait(probe, page, lambda: count(hues(page), PURPLE, (*BARE, 0.15), margin=40) == 0)


def test_the_button_pauses_the_node_and_lets_it_go_on(probe: Probe, page: Any) -> None:
    page.get_by_role("button", name="Pause").click()
    wait(probe, page, lambda: probe.diagnostics("physics")["paused"] == "True")
    page.get_by_role("button", name="Continue").click()
    wait(probe, page, lambda: probe.diagnostics("physics")["paused"] == "False")
    page.get_by_role("button", name="Pause").wait_for()


def test_a_refusal_is_told_once(probe: Probe, page: Any) -> None:
    """The button gets a key: a mouse that is pressed on it while its folder opens may be released beside it, because
    playwright scrolls the folder, and its opening scrolls it back."""
    page.get_by_text("Step and reset").click()
    page.get_by_role("button", name="Step", exact=True).press("Enter")
    told = page.get_by_text("the physics is running; pause it first")
    wait(probe, page, told.count)
    page.wait_for_timeout(1000)
    assert told.count() == 1


def test_a_click_tells_the_name_of_a_body_and_its_patch(probe: Probe, page: Any) -> None:
    page.mouse.click(*pixel(position(probe, "flat")))
    page.get_by_text("triangles of ground in reach").wait_for()
    page.get_by_text("flat").first.wait_for()
    page.mouse.click(*pixel(position(probe, "waves")))
    page.get_by_text("waves").first.wait_for()


def test_a_click_spawns_a_ball_where_it_met_the_ground(probe: Probe, page: Any) -> None:
    page.locator("input[value='shows what it is']").first.click()
    page.get_by_role("option", name="spawns a ball").click()
    page.mouse.click(*pixel((*BARE, 0.0)))
    x, y, _ = position(probe, "ball_1")
    assert math.dist((x, y), BARE) < 0.05
    assert probe.call("remove_body", RemoveBody, id="ball_1").success
    page.mouse.click(WIDTH / 2, 5)  # far beyond the map
    page.get_by_text("There is no ground where you clicked.").wait_for()


def test_a_slider_sets_a_parameter_and_a_refusal_says_why(probe: Probe, page: Any) -> None:
    before = parameter(probe, "physics.friction")
    page.get_by_role("tab", name="Parameters").click()
    row(page, "friction").get_by_role("slider").focus()
    page.keyboard.press("ArrowRight")
    wait(probe, page, lambda: parameter(probe, "physics.friction") > before)
    field = row(page, "gravity").get_by_role("textbox")
    field.fill("[0.0, 1.0]")
    field.press("Enter")
    page.get_by_text("is refused:").wait_for()
    assert parameter(probe, "physics.gravity") == [0.0, 0.0, -9.81]


def test_a_page_opens_with_the_bodies_in_sight(probe: Probe, url: str, browser: Any, page: Any) -> None:
    """Also one that opens when bodies have gone elsewhere."""
    for name in ("flat", "waves"):
        probe.call("remove_body", RemoveBody, id=name)
    for corner in ((5.0, 5.0), (-5.0, 5.0)):
        spawn(probe, "corner", corner)
        position(probe, "corner")
        opened = open_page(browser, url)
        # Beside the panel.
        wait(probe, opened, lambda opened=opened: like(hues(opened)[:, : WIDTH - 340], PURPLE) > 300)
        opened.close()
        assert probe.call("remove_body", RemoveBody, id="corner").success
