"""Every structure of a tick fills the block it lies in, as its layout declares it, and no array lies on another."""

from __future__ import annotations

import numpy as np
import pytest

from aerial_model.kinematics import LAYOUT as CONFIGURATION
from aerial_model.kinematics import configuration_in
from aerial_wbic.estimation.filter_state import FILTER_STATE, filter_state_in
from aerial_wbic.force_qp.contact_acceleration import CONTACT_ACCELERATION, contact_acceleration_in
from aerial_wbic.force_qp.equations import SOLUTION, solution_in
from aerial_wbic.force_qp.solvers import PROGRAM, program_in
from aerial_wbic.joint_command import LAW, law_in
from aerial_wbic.target import TARGET, target_in
from aerial_wbic.tasks.limbs import JOINTS, joints_in
from aerial_wbic.tasks.ordering import ORDERING, ordering_in

LAYOUTS = {
    "configuration": (CONFIGURATION, configuration_in),
    "target": (TARGET, target_in),
    "filter state": (FILTER_STATE, filter_state_in),
    "joints": (JOINTS, joints_in),
    "ordering": (ORDERING, ordering_in),
    "program": (PROGRAM, program_in),
    "contact acceleration": (CONTACT_ACCELERATION, contact_acceleration_in),
    "solution": (SOLUTION, solution_in),
    "actuator law": (LAW, law_in),
}


def arrays(structure):
    """All arrays of a structure and of those in it."""
    for value in structure:
        if isinstance(value, tuple):
            yield from arrays(value)
        elif isinstance(value, np.ndarray) and value is not getattr(structure, "block", None):
            yield value


@pytest.mark.parametrize("size", [3, 8])
@pytest.mark.parametrize("name", LAYOUTS)
def test_a_structure_fills_its_block(name, size):
    layout, structure_in = LAYOUTS[name]
    header = [each.replace(".", "__") for each in (*layout.sizes, *layout.numbers)]
    block = layout.block(**dict.fromkeys(header, size))
    untouched = block.copy()
    found = list(arrays(structure_in(block)))
    for array in found:
        array[:] = 1
    assert len(found) == len(layout.arrays)
    np.testing.assert_array_equal(block[: len(header)], untouched[: len(header)])
    assert block[len(header) :].all()
    nbytes = sum(array.nbytes for array in found)
    padding = len(layout.flags) * (block.itemsize - 1)  # of truth values, to a whole number
    assert nbytes <= block[len(header) :].nbytes <= nbytes + padding
