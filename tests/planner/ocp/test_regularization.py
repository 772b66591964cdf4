"""Algorithm IC: the sequence of multiples of the identity, from Wächter and Biegler's constants."""

import pytest

from aerial_planner.ocp.regularization import Regularization


def test_the_first_sequence_rises_by_a_hundred_until_it_is_too_much():
    regularization, tried = Regularization(), [0.0]
    while (following := regularization.more(tried[-1])) is not None:
        tried.append(following)
    assert tried[1:] == pytest.approx([1e-4 * 100.0**i for i in range(8)])


def test_later_ones_begin_at_a_third_of_the_last_and_rise_by_eight():
    regularization = Regularization(last=0.3)
    first = regularization.more(0.0)
    assert first == pytest.approx(0.1)
    assert regularization.more(first) == pytest.approx(0.8)


def test_a_rejected_step_is_tried_with_eight_times_as_much_up_to_a_limit():
    regularization, tried = Regularization(), []
    while (following := regularization.after_rejection()) is not None:
        tried.append(following)
    assert tried == pytest.approx([1e-4 * 8.0**i for i in range(12)])
