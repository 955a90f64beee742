"""The device contract on Blender's device, on the backend that the run asked for."""

import weakref

import gpu
import numpy as np
import pytest

import rebound
from rebound.device import DrawState, blender
from rebound.device.blender import BlenderDevice
from rebound.gpu_shaders import all_shaders
from rebound.tests.support.device_contract import *  # noqa: F403
from rebound.tests.support.device_contract import fragment, show
from rebound.tests.support.device_contract_draw import *  # noqa: F403
from rebound.tests.support.device_contract_draw import canvas
from rebound.tests.support.device_contract_errors import *  # noqa: F403


@pytest.fixture(scope="module")
def blender_device(gpu_backend):
    return BlenderDevice()


@pytest.fixture
def device(blender_device):
    return blender_device


# --- only in Blender -------------------------------------------------------------------------------------------------

FADE = fragment("fade", "void main() { out_color = vec4(uv, pc_blue, 1.0); }", constants={"pc_blue": "FLOAT"})


@pytest.fixture
def screen(device):
    """A bound framebuffer with a viewport of its own, as view_draw finds it: (texture, framebuffer)."""
    texture = device.texture((8, 4), "RGBA32F")
    framebuffer = gpu.types.GPUFrameBuffer(color_slots=(texture.handle,))
    with framebuffer.bind():
        gpu.state.viewport_set(4, 0, 4, 4)
        yield texture, framebuffer


def test_draw_to_current_fills_the_viewport(device, screen):
    device.draw_to_current(FADE, pc_blue=0.5)
    values = device.read(screen[0])
    assert not values[:, :4].any()
    np.testing.assert_allclose(values[0, 4], [1 / 8, 1 / 8, 0.5, 1], atol=1e-6)
    with pytest.raises(TypeError, match="fade.*missing pc_blue"):
        device.draw_to_current(FADE)


def test_work_leaves_framebuffer_viewport_and_state_alone(device, screen):
    target = canvas(device, (16, 16), depth=True)
    state = DrawState(depth_test="LESS_EQUAL", depth_write=True, blend="ADDITIVE")
    device.fullscreen(FADE, target, state=state, viewport=(1, 2, 3, 4), pc_blue=1.0)
    device.clear(target, viewport=(0, 0, 2, 2))
    device.read(target.colors[0])
    device.finish()
    assert gpu.state.active_framebuffer_get() == screen[1]
    assert gpu.state.viewport_get() == (4, 0, 4, 4)
    assert gpu.state.depth_test_get() == "NONE"
    assert gpu.state.depth_mask_get() is False
    assert gpu.state.blend_get() == "NONE"
    device.draw_to_current(FADE, pc_blue=0.5)
    assert device.read(screen[0])[..., 2].sum() == 0.5 * 16


def test_failure_before_a_draw_leaves_framebuffer_and_device_alone(device, screen, monkeypatch):
    target = canvas(device)
    for draw in (
        lambda: device.fullscreen(FADE, target, pc_blue=1.0),
        lambda: device.draw_to_current(FADE, pc_blue=1.0),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(blender, "_set_state", lambda _state: 1 / 0)
            with pytest.raises(ZeroDivisionError):
                draw()
        assert gpu.state.active_framebuffer_get() == screen[1]
        assert gpu.state.viewport_get() == (4, 0, 4, 4)
    assert show(device, FADE, pc_blue=0.5)[0, 0, 2] == 0.5


def test_closed_device_holds_nothing():
    device = BlenderDevice()
    device.finish()
    pixel = weakref.ref(device._pixel)
    assert pixel() is not None and device._attributeless is not None
    device.close()
    device.close()
    assert not pixel() and device.allocated_bytes == 0
    assert not any(getattr(device, name) for name in ("_attributeless", "_pixel", "_bound"))


def test_no_shader_is_bound_when_the_extension_is_disabled(device, monkeypatch):
    show(device, FADE, pc_blue=1.0)
    calls = []
    monkeypatch.setattr(gpu.shader, "unbind", lambda: calls.append(1))
    rebound.unregister()
    assert calls == [1]


@pytest.mark.parametrize("shader", all_shaders(), ids=lambda shader: shader.name)
def test_declared_shader_compiles(device, shader):
    assert device._program(shader).shader == shader


def test_programs_outlive_a_device(device):
    show(device, FADE, pc_blue=1.0)
    assert BlenderDevice()._program(FADE) is device._program(FADE)
