# SPDX-License-Identifier: GPL-3.0-or-later
"""The device contract on Blender's device, on the backend that the run asked for."""

import pytest

from rebound.device.blender import BlenderDevice
from rebound.tests.support.device_contract import *  # noqa: F403
from rebound.tests.support.device_contract_draw import *  # noqa: F403


@pytest.fixture(scope="module")
def blender_device(gpu_backend):
    return BlenderDevice()


@pytest.fixture
def device(blender_device):
    return blender_device
