"""What several files of these tests make and free alike."""

import pytest

from rebound.tests.support.voxel_reference import Room


@pytest.fixture
def room(headless_device):
    """Make rooms: freed at the end."""
    made = []

    def make(*args, **options) -> Room:
        made.append(Room(headless_device, *args, **options))
        return made[-1]

    yield make
    for one in made:
        one.free()
    assert headless_device.error == "GL_NO_ERROR"
