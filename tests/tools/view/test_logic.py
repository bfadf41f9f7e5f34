"""What the page is made of, without a browser: knobs from descriptions, charts of timings, and looks of bodies."""

import asyncio
import colorsys
import itertools
import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from smartmesh_msgs.msg import BodyDescription, StageTiming, Timing

from smartmesh_ros.errors import InputError
from smartmesh_ros.node.parameters import declaring
from smartmesh_ros.node.parameters.specifications import SPECS
from smartmesh_ros.tools.client.patch import KINDS
from smartmesh_ros.tools.testing import TIMEOUT
from tests.examples import examples

pytest.importorskip("viser", reason="viser is not installed; scripts/workspace run dev view")


from smartmesh_ros.tools.client.sight import Sight
from smartmesh_ros.tools.view import looks
from smartmesh_ros.tools.view.knobs import knob_of, nice_step, parameter_of, shown_value
from smartmesh_ros.tools.view.looks import PatchLook, patch_look
from smartmesh_ros.tools.view.main import main
from smartmesh_ros.tools.view.page import Page, start_server, url_of
from smartmesh_ros.tools.view.panel import chart_data


def knobs() -> dict:
    """Knobs of all of the node's parameters, at their defaults, from the descriptions that the node declares."""
    found = {}
    for spec in SPECS:
        descriptor = declaring._descriptor(spec)
        descriptor.name = spec.name
        found[spec.name] = knob_of(descriptor, spec.default)
    return {name: knob for name, knob in found.items() if knob is not None}


def test_every_parameter_that_may_change_has_a_knob_with_the_bounds_and_choices_of_the_node() -> None:
    found = knobs()
    assert found.keys() == {spec.name for spec in SPECS if not spec.read_only}
    for spec in SPECS:
        if (knob := found.get(spec.name)) is None:
            continue
        assert spec.description in knob.options["hint"]
        assert tuple(knob.options.get("options", ())) == spec.choices
        if isinstance(spec.default, int | float) and not isinstance(spec.default, bool):
            assert (knob.options["min"], knob.options["max"]) == (spec.low, spec.high)
            assert spec.low <= knob.value <= spec.high
            assert type(knob.options["step"]) is type(spec.default)
        sent = parameter_of(knob, knob.value).value
        assert declaring.checked_value(spec, sent) == spec.default, sent
    kinds = {
        "physics.friction": "slider", "terrain.motion": "dropdown", "physics.sleep": "checkbox",
        "physics.gravity": "text", "physics.solver_residual": "number",  # no slider can be set to 1e-7 of 1
    }  # fmt: skip
    assert {name: found[name].kind for name in kinds} == kinds


@given(low=st.floats(0, 1), length=st.floats(0.1, 1e4), share=st.floats(0, 1))
@example(low=0.0, length=451.0, share=2.220446049250313e-16)
@examples(200)
def test_sliders_can_stand_at_values_of_few_digits(low: float, length: float, share: float) -> None:
    value = round(float(f"{low + share * length:.3g}"), 9)
    step = nice_step(value, low, low + length)
    assert abs(value / step - round(value / step)) < 1e-3
    assert step <= length / 100


def test_a_small_number_has_the_digits_that_show_it(server: Any) -> None:
    """More than viser gives it."""
    shown = knobs()["physics.solver_residual"].add_to(server.gui)
    assert shown.value == float(f"{shown.value:.{shown.precision}f}") > 0.0


def test_a_text_that_is_no_list_is_refused_with_an_example() -> None:
    knob = knobs()["physics.gravity"]
    assert list(parameter_of(knob, "[0, 0, -1]").value) == [0.0, 0.0, -1.0]
    for wrong in ("", "0, 0", "[0, 0", "{a: 1}", "[0, down]", "[[0], 0]", "[2024-13-01]"):
        with pytest.raises(InputError, match=r"must be a list, such as \[0.0, 0.0, -9.81\]"):
            parameter_of(knob, wrong)
    assert shown_value([0.0, 1.0]) == "[0.0, 1.0]"


def timings_of(totals: list[float]) -> list[tuple[float, Timing]]:
    """Messages of ~/timing a second apart, with the medians of a step [ms]."""
    stages = ([StageTiming(stage="total", p50_us=1e3 * one), StageTiming(stage="step", p50_us=1.0)] for one in totals)
    return [(float(at), Timing(stages=of_message)) for at, of_message in enumerate(stages)]


def test_the_chart_has_the_medians_of_the_last_minute_by_their_age() -> None:
    ages, totals, steps, *others = chart_data(timings_of([1.0] * 10 + [0.0, 1000.0]), 65.0)
    assert ages.tolist() == [-59.0, -58.0, -57.0, -56.0, -55.0, -54.0]
    np.testing.assert_allclose(totals, [1.0, 1.0, 1.0, 1.0, np.nan, 1000.0], rtol=1e-5)
    assert steps == pytest.approx(1e-3) and np.isnan(others).all(), "a stage that did not run is no point"


def test_every_kind_of_patch_has_a_colour_that_is_told_apart() -> None:
    seen = {patch_look(kind, stride) for kind in KINDS.values() for stride in (1, 2, 3, 4, 5, 100)}
    assert seen == set(PatchLook)
    assert patch_look("heightfield", 1) is not patch_look("trimesh", 1)
    for one, other in itertools.combinations(PatchLook, 2):
        first, second = (np.array(colorsys.rgb_to_yiq(*np.divide(look.colour, 255))) for look in (one, other))
        assert np.linalg.norm(first - second) > 0.1, (one, other)


@pytest.mark.parametrize(
    ("kind", "dimensions", "radius"),
    [
        (BodyDescription.SPHERE, (0.5,), 0.5), (BodyDescription.BOX, (0.2, 0.4, 0.6), 0.14**0.5),
        (BodyDescription.CYLINDER, (0.8, 0.3), 0.5), (BodyDescription.CAPSULE, (0.8, 0.3), 0.7),
    ],
)  # fmt: skip
def test_shapes_are_closed_and_reach_to_their_radius(kind: int, dimensions: tuple[float, ...], radius: float) -> None:
    mesh = looks.shape_mesh(kind, dimensions)
    assert mesh.is_watertight
    assert np.allclose(mesh.centroid, 0.0, atol=1e-6)
    assert np.linalg.norm(mesh.vertices, axis=1).max() == pytest.approx(radius, rel=1e-3)
    described = BodyDescription(shape=kind, dimensions=dimensions)
    assert Sight(appearances={"body": described}).radius_of("body") == pytest.approx(radius, rel=1e-9)


def contacts_of(forces: list[float]) -> np.ndarray:
    """Contacts of upright forces at the origin."""
    return np.column_stack([np.zeros((len(forces), 5)), np.ones(len(forces)), forces])


@given(forces=st.lists(st.floats(0.1, 1e4), min_size=1, max_size=20))
@examples(50)
def test_arrows_are_longer_for_larger_forces_and_never_too_long(forces: list[float]) -> None:
    points = looks.arrows(contacts_of(forces), 0.7)
    lengths = points[:, 1, 2] - points[:, 0, 2]
    assert lengths.max() == pytest.approx(0.7)
    assert (np.diff(lengths[np.argsort(forces)]) >= -1e-12).all()
    assert len(looks.arrows(contacts_of([math.nan, 0.0, 5.0]), 1.0)) == 1, "those without a force have none"


def test_a_page_is_refreshed_by_the_thread_that_sends_it(server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """From another thread, viser now and then failed with "deque mutated during iteration"."""
    loops: list[Any] = []
    page = Page.__new__(Page)
    page._server = server

    async def refresh(_: Page) -> None:
        loops.append(asyncio.get_running_loop())

    monkeypatch.setattr(Page, "_refresh", refresh)
    page.refresh()
    assert loops == [server.get_event_loop()]


@pytest.mark.parametrize("host", ["203.0.113.1", "nowhere.invalid", "a..b"])
def test_a_host_that_is_not_this_machine_is_refused(host: str) -> None:
    """viser would wait forever."""
    with pytest.raises(InputError, match=f"cannot listen on '{host}': .* name an address of this machine"):
        start_server(host, 0)


def test_addresses_are_those_of_a_browser() -> None:
    assert url_of("0.0.0.0", 8080) == url_of("::", 8080) == url_of("", 8080) == "http://localhost:8080"
    assert url_of("::1", 8080) == "http://[::1]:8080"


def test_a_view_of_a_node_needs_no_matplotlib() -> None:
    code = "import sys; sys.modules['matplotlib'] = None; from smartmesh_ros.tools.view import main, page"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=TIMEOUT)


def test_an_option_that_means_nothing_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    """The name of a node: tests/node/test_command.py."""
    for option, value, words in (("--rate", "0", "'0' is no number from 1"), ("--port", "99999", "no whole number")):
        with pytest.raises(SystemExit, match="2"):
            main([option, value])
        assert words in capsys.readouterr().err
