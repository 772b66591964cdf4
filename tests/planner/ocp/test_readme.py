"""The README's example runs as it stands there, and finds the optimum that is known in closed form."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from aerial_planner.ocp import problem

README = Path(problem.__file__).with_name("README.md")


@pytest.fixture(scope="module")
def example():
    """Return the names that the example defines."""
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    names = {}
    exec(code, names)
    return names


def free_fall_then_full_thrust(height, speed, mass, gravity, exhaust, thrust):
    """Return duration and final mass of the fuel-optimal landing, from the rocket equation."""
    flow = thrust / exhaust

    def at_touchdown(times):
        fall, burn = times
        h, v, m = height + speed * fall - gravity * fall**2 / 2, speed - gravity * fall, mass - flow * burn
        gained = exhaust * (burn - m / flow * np.log(mass / m))
        return h + v * burn - gravity * burn**2 / 2 + gained, v - gravity * burn + exhaust * np.log(mass / m)

    fall, burn = fsolve(at_touchdown, [10.0, 10.0])
    return fall + burn, mass - flow * burn


def test_the_example_lands_with_the_least_fuel(example):
    constants = (example[name] for name in ("GRAVITY", "EXHAUST", "THRUST"))
    duration, mass = free_fall_then_full_thrust(*example["at_start"], *constants)
    assert example["solution"].converged
    assert example["mass"] == pytest.approx(mass, abs=0.01)  # [kg]
    assert example["duration"] == pytest.approx(duration, abs=0.1)  # [s]


def test_the_example_switches_once_from_no_thrust_to_full_thrust(example):
    thrust = np.array(example["solution"].u[:-1]).ravel()
    switching = np.flatnonzero((thrust > 1e-3) & (thrust < 1 - 1e-3))
    assert len(switching) <= 1
    assert np.all(np.diff(thrust) > -1e-3)
