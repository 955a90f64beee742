"""Every kind of node against Cycles: what it gives at the same place. `tools/node_table.py` prints the same figures."""

import pytest

from rebound.device.blender import BlenderDevice
from rebound.tests.support.node_cases import GROUPS
from rebound.tests.support.node_sheet import deviations

# Their shaders take a software GPU seconds each to compile.
SLOW = {"noise", "voronoi"}


@pytest.mark.parametrize("group", [pytest.param(g, marks=pytest.mark.slow) if g in SLOW else g for g in GROUPS])
def test_nodes_give_what_cycles_gives(clean_scene, tmp_path, group):
    cases = list(GROUPS[group]())
    wrong = [
        f"{case.name}: {largest:.1e}, {case.inputs}"
        for case, largest in zip(cases, deviations(BlenderDevice(), tmp_path, cases), strict=True)
        if largest > case.tolerance
    ]
    assert not wrong, "\n".join(wrong)
