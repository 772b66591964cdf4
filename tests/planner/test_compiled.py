"""Compiled stage functions: the same numbers, found again, never stale."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from aerial_planner.compiled import CompilationError, FunctionLibrary
from aerial_planner.nlp import FlatProgram
from aerial_planner.planner import Planner
from aerial_planner.solver import SolverName, SolverOptions
from aerial_planner.stage import Rows, StageKind

from .conftest import jump


@pytest.fixture
def kind():
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
    rows = Rows()
    rows.between("limit", ca.sin(x[0]) * u, -1.0, 1.0)
    return rows.stage("swing", x, u, p, ca.exp(x[1]) * u**2, ca.vertcat(x[1], p * ca.cos(x[0]) + u))


@pytest.fixture
def library(tmp_path):
    return FunctionLibrary(tmp_path)


def test_compiled_functions_give_the_interpreted_numbers(library, kind):
    assert library.load(kind) is None
    assert library.compile(kind)
    compiled, interpreted = library.load(kind), kind.functions()
    rng = np.random.default_rng(0)
    for name in ("values", "gradient", "jacobian", "hessian"):
        ours, theirs = getattr(compiled, name), getattr(interpreted, name)
        arguments = [rng.normal(size=theirs.size_in(i)) for i in range(theirs.n_in())]
        for a, b in zip(ours.call(arguments), theirs.call(arguments), strict=True):
            np.testing.assert_allclose(ca.DM(a).full(), ca.DM(b).full(), atol=1e-14)


def test_what_is_compiled_is_not_compiled_again(library, kind):
    library.compile(kind)
    assert not library.compile(kind)


def test_an_expression_that_has_changed_is_another(library, kind):
    library.compile(kind)
    assert library.load(dataclasses.replace(kind, cost=2 * kind.cost)) is None
    assert library.load(dataclasses.replace(kind, constraints=kind.constraints + kind.p)) is None


def test_bounds_are_no_part_of_what_is_compiled(library, kind):
    library.compile(kind)
    assert library.load(dataclasses.replace(kind, upper=kind.upper + 1)) is not None


def test_a_problem_solves_with_compiled_functions_and_without(library, kind):
    x = ca.SX.sym("x", 2)
    end = Rows()
    end.equal("goal", x - ca.DM([0.2, 0.1]))
    kinds = [kind, end.stage("end", x, ca.SX(0, 1), ca.SX(0, 1), ca.SX(0), None)]
    for k in kinds:
        library.compile(k)
    options = SolverOptions(solver=SolverName.FATROP)
    programs = [
        FlatProgram(kinds, functions_of, options).functions for functions_of in (StageKind.functions, library.load)
    ]
    point = np.random.default_rng(1).normal(size=programs[0]["nlp_g"].size1_in(0))
    for name in ("nlp_f", "nlp_g", "nlp_jac_g"):
        a, b = (functions[name].call([point, np.ones(1)])[-1] for functions in programs)
        np.testing.assert_allclose(ca.DM(a).full(), ca.DM(b).full(), atol=1e-14)


def test_without_a_compiler_there_is_a_sentence(library, kind, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(CompilationError, match="no C compiler"):
        library.compile(kind)


def test_a_planner_without_cache_refuses_to_compile(planner):
    with pytest.raises(ValueError, match="nowhere to compile to"):
        planner.compile([jump(0.1, 0.0)], print)


def test_a_cold_cache_changes_nothing(robot, forward, tmp_path):
    plan = Planner(robot, cache=tmp_path).plan(jump(0.4, 0.0)).plan
    np.testing.assert_array_equal(plan.q, forward.plan.q)


def test_no_plan_waits_for_numba():
    """In a process of its own: what other tests have compiled would hide it."""
    script = Path(__file__).with_name("plans_of_everything.py")
    process = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert (process.returncode, process.stdout.strip()) == (0, "compiled for a plan: nothing"), process.stderr
