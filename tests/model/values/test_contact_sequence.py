import numpy as np
import pytest

from aerial_model.values.contact_sequence import ContactPhase, ContactSequence

PAIR = np.array([True, False, False, True])
OTHER_PAIR = ~PAIR
HOLDS = np.arange(12.0).reshape(4, 3)


def trot(*durations):
    """Return a sequence that changes between two diagonal pairs."""
    masks = (PAIR, OTHER_PAIR)
    phases = [ContactPhase(duration=d, contact=masks[i % 2], foothold=HOLDS + i) for i, d in enumerate(durations)]
    return ContactSequence(phases=tuple(phases))


@pytest.mark.parametrize(("time", "index"), [(-1.0, 0), (0.0, 0), (0.099, 0), (0.1, 1), (0.29, 1), (0.3, 2), (9.0, 2)])
def test_a_phase_begins_where_the_one_before_ends(time, index):
    assert trot(0.1, 0.2, 0.1).index(time) == index


def test_the_duration_is_that_of_all_phases():
    assert trot(0.1, 0.2, 0.1).duration == pytest.approx(0.4)


def test_a_point_keeps_its_foothold_while_it_bears_load():
    first = ContactPhase(duration=0.1, contact=PAIR, foothold=HOLDS)
    moved = ContactPhase(duration=0.1, contact=np.ones(4, dtype=bool), foothold=HOLDS + [0.0, 0.0, 0.01])
    with pytest.raises(ValueError, match=r"moves by 0\.01 m while it bears load"):
        ContactSequence(phases=(first, moved))


def test_a_point_may_land_elsewhere_after_a_swing():
    assert trot(0.1, 0.1, 0.1).phases[2].foothold[0, 0] == HOLDS[0, 0] + 2


@pytest.mark.parametrize("duration", [0.0, -0.1, float("nan"), float("inf")])
def test_a_duration_is_positive_and_finite(duration):
    with pytest.raises(ValueError, match="positive duration"):
        ContactPhase(duration=duration, contact=PAIR, foothold=HOLDS)


def test_footholds_are_one_a_point():
    with pytest.raises(ValueError, match=r"shape \(4, 3\)"):
        ContactPhase(duration=0.1, contact=PAIR, foothold=HOLDS[:3])


def test_a_sequence_has_phases_of_the_same_points():
    phase = ContactPhase(duration=0.1, contact=PAIR, foothold=HOLDS)
    other = ContactPhase(duration=0.1, contact=PAIR[:2], foothold=HOLDS[:2])
    for phases, sentence in (((), "at least one"), ((phase, other), "4 points in all phases")):
        with pytest.raises(ValueError, match=sentence):
            ContactSequence(phases=phases)
