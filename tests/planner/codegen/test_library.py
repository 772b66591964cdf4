"""Compiled stage functions: the same numbers, found again, never stale."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from aerial_planner.codegen import c_source
from aerial_planner.codegen.library import CompilationError, FunctionLibrary
from aerial_planner.ocp.interior_point import InteriorPoint
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.ocp.stage import Rows, StageEvaluation, StageKind
from aerial_planner.planner import Planner

from ..conftest import jump


@pytest.fixture
def kind():
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
    rows = Rows()
    rows.between("limit", ca.sin(x[0]) * u, -1.0, 1.0)
    return rows.stage("swing", x, u, p, ca.exp(x[1]) * u**2, ca.vertcat(x[1], p * ca.cos(x[0]) + u))


@pytest.fixture
def library(tmp_path):
    return FunctionLibrary(tmp_path)


def evaluated(function, n, arguments, sizes):
    """Return the results of a function at n points."""
    results = [np.full(n * size, np.nan) for size in sizes]
    function.bind(n, arguments, results)()
    return results


@pytest.mark.parametrize("block", [300, 7])  # operations: all in one, or values handed from one to the next
@pytest.mark.parametrize("n", [1, 4, 6])  # points: some lanes left over, none, both
def test_compiled_functions_give_the_interpreted_numbers_to_the_last_bit(library, kind, n, block, monkeypatch):
    monkeypatch.setattr(c_source, "_BLOCK", block)
    assert library.load(kind) is None
    assert library.compile(kind)
    rng = np.random.default_rng(0)
    for ours, theirs, function in zip(library.load(kind), kind.interpreted(), kind.batch_functions(), strict=True):
        arguments = [rng.normal(size=n * function.nnz_in(i)) for i in range(function.n_in())]
        sizes = [function.nnz_out(i) for i in range(function.n_out())]
        for i, (a, b) in enumerate(
            zip(evaluated(ours, n, arguments, sizes), evaluated(theirs, n, arguments, sizes), strict=True)
        ):
            np.testing.assert_array_equal(a, b)
            np.testing.assert_array_equal(ours.nonzeros(i), theirs.nonzeros(i))


def test_rows_of_another_size_are_refused(library, kind):
    library.compile(kind)
    for values in (library.load(kind)[0], kind.interpreted().values):
        arguments, results = [np.zeros(6), np.zeros(2)], [np.zeros(2), np.zeros(4), np.zeros(2)]
        values.bind(2, arguments, results)
        for wrong in (
            (arguments, [*results[:2], np.zeros(3)]),
            (arguments[:1], results),
            ([np.zeros(3), arguments[1]], results),
        ):
            with pytest.raises(ValueError, match="expected rows of"):
                values.bind(2, *wrong)


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


def test_a_problem_solves_alike_with_compiled_functions_and_without(library, kind):
    x = ca.SX.sym("x", 2)
    end = Rows()
    end.equal("goal", x - ca.DM([0.2, 0.1]))
    kinds = [kind] * 6 + [end.stage("end", x, ca.SX(0, 1), ca.SX(0, 1), ca.SX(0), None)]
    for k in kinds:
        library.compile(k)
    free = np.full(6 * 3 + 2, np.inf)
    outcomes = [
        InteriorPoint(kinds, evaluation_of, SolverOptions()).solve(np.zeros(len(free)), np.ones(6), -free, free)
        for evaluation_of in (StageKind.interpreted, lambda kind: StageEvaluation(*library.load(kind)))
    ]
    assert outcomes[0].converged
    np.testing.assert_array_equal(outcomes[0].w, outcomes[1].w)


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
