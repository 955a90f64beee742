"""A contract of every property, of scene, light and object: it says what it is, animates, can be driven, undoes."""

import bpy
import pytest

from rebound.bake_settings import BAKE_SETTINGS
from rebound.settings import (
    DISPLAY_SETTINGS,
    LIGHT_SETTINGS,
    OBJECT_SETTINGS,
    VIEWPORT_SETTINGS,
    choice_number,
    named_settings,
)
from rebound.tests.support.engine_build import rebound_scene

__all__ = ["rebound_scene"]


def every_property():
    """(owner, property, setting's full name, Setting), a viewport's own value as a property of its own."""
    for name, setting in named_settings():
        yield "scene", name, name, setting
        if setting.viewport_default is not None:
            yield "scene", f"viewport_{name}", name, setting
    for setting in (*VIEWPORT_SETTINGS, *DISPLAY_SETTINGS):
        yield "scene", f"viewport_{setting.name}", f"viewport_{setting.name}", setting
    for owner, settings in (("scene", BAKE_SETTINGS), ("light", LIGHT_SETTINGS), ("object", OBJECT_SETTINGS)):
        for setting in settings:
            yield owner, setting.name, setting.name, setting


EVERY = list(every_property())
IDS = [f"{owner}.{name}" for owner, name, _, _ in EVERY]
each = pytest.mark.parametrize(("owner", "name", "full_name", "setting"), EVERY, ids=IDS)


def data_block(scene, owner):
    return {"scene": scene, "light": bpy.data.lights["Spot"], "object": bpy.data.objects["Box"]}[owner]


def two_values(name, setting):
    """Two different values of a setting, as Python has them and as a curve does."""
    if setting.kind == "ENUM":
        keys = [setting.items[0].key, setting.items[-1].key]
        return keys, [choice_number(name, key) for key in keys]
    if setting.kind == "BOOL":
        return [False, True], [0, 1]
    low = setting.minimum
    high = min(setting.maximum, low + 1 if setting.kind == "INT" else low + 0.5 * (setting.maximum - low))
    values = [int(low), int(high)] if setting.kind == "INT" else [low, high]
    return values, values


def read(block, name):
    return getattr(block.rebound, name)


@each
def test_property_is_there_with_unit_and_trade_off(rebound_scene, owner, name, full_name, setting):
    entry = data_block(rebound_scene, owner).rebound.bl_rna.properties[name]
    assert setting.description.rstrip(".") in entry.description
    assert entry.description.endswith(f". Unit: {setting.unit}" if setting.unit else setting.description)
    assert entry.is_animatable and not entry.is_readonly
    wanted = setting.default if name == full_name else setting.viewport_default
    assert entry.default == (pytest.approx(wanted) if isinstance(wanted, float) else wanted)


@each
def test_property_animates(rebound_scene, owner, name, full_name, setting):
    """Keyframes on frames 1 and 20 are what the render sees there."""
    block = data_block(rebound_scene, owner)
    values, _ = two_values(full_name, setting)
    for frame, value in zip((1, 20), values, strict=True):
        setattr(block.rebound, name, value)
        assert block.rebound.keyframe_insert(name, frame=frame)
    for frame, value in zip((1, 20), values, strict=True):
        rebound_scene.frame_set(frame)
        evaluated = block.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert read(evaluated, name) == (pytest.approx(value) if isinstance(value, float) else value)


@each
def test_property_can_be_driven(rebound_scene, owner, name, full_name, setting):
    """By a driver that reads the frame: it gives the one value first and then the other."""
    block = data_block(rebound_scene, owner)
    values, numbers = two_values(full_name, setting)
    driver = block.rebound.driver_add(name).driver
    driver.expression = f"{numbers[0]} if frame < 10 else {numbers[1]}"
    for frame, value in zip((1, 20), values, strict=True):
        rebound_scene.frame_set(frame)
        evaluated = block.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert read(evaluated, name) == (pytest.approx(value) if isinstance(value, float) else value)


@pytest.mark.parametrize("owner", ["scene", "light", "object"])
def test_properties_undo(rebound_scene, owner):
    """All of a data-block's in one step: an undo in background reads the whole file anew."""
    mine = [(name, *two_values(full, setting)[0]) for o, name, full, setting in EVERY if o == owner]

    def put(which):
        for name, *values in mine:
            setattr(data_block(bpy.context.scene, owner).rebound, name, values[which])

    def found():
        block = data_block(bpy.context.scene, owner)
        return {name: pytest.approx(read(block, name)) if type(read(block, name)) is float else read(block, name)
                for name, *_ in mine}  # fmt: skip

    put(0)
    bpy.ops.ed.undo_push(message="first")
    before = found()
    put(1)
    bpy.ops.ed.undo_push(message="second")
    after = found()
    assert before != after
    bpy.ops.ed.undo()
    assert found() == before
    bpy.ops.ed.redo()
    assert found() == after
