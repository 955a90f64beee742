"""The device contract on the standalone device."""

import pytest

from rebound.tests.support.device_contract import *  # noqa: F403
from rebound.tests.support.device_contract_draw import *  # noqa: F403
from rebound.tests.support.device_contract_errors import *  # noqa: F403


@pytest.fixture
def device(headless_device):
    """The standalone device; OpenGL must have nothing to complain of before and after a test."""
    assert headless_device.error == "GL_NO_ERROR"
    yield headless_device
    assert headless_device.error == "GL_NO_ERROR"
