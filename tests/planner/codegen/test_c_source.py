"""The C that is written computes what CasADi computes, whatever the number of points."""

import ctypes
import re
import subprocess

import casadi as ca
import numpy as np
import pytest

from aerial_planner.codegen import c_source
from aerial_planner.codegen.library import CompilationError, CompiledFunction, FunctionLibrary


@pytest.fixture
def library(tmp_path):
    return FunctionLibrary(tmp_path)


def evaluated(function, n, arguments, sizes):
    """Return the results of a function at n points."""
    results = [np.full(n * size, np.nan) for size in sizes]
    function.bind(n, arguments, results)()
    return results


def test_every_operation_there_is_c_for_is_computed_as_casadi_does(library):
    x = ca.SX.sym("x", 2)
    a, b = ca.vertsplit(x)
    unary = [ca.sqrt, ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.tanh, ca.exp, ca.log, ca.fabs, lambda v: -v]
    binary = [
        a + b,
        a - b,
        a * b,
        a / b,
        a**b,
        ca.atan2(a, b),
        ca.fmin(a, b),
        ca.fmax(a, b),
        a**2,
        2 * a,
        1 / a,
        a**1.7,
    ]
    f = ca.Function("operations", [x], [ca.vertcat(*(u(a) for u in unary), *binary, np.inf, a)])
    assert library.compile_function(f)
    points = np.random.default_rng(1).uniform(0.1, 0.9, size=5 * 2)
    (ours,) = evaluated(library.load_function(f), 5, [points], [f.nnz_out(0)])
    theirs = np.hstack([f(point).full().ravel() for point in points.reshape(5, 2)])
    np.testing.assert_allclose(ours, theirs, rtol=1e-15)


def test_an_operation_there_is_no_c_for_is_named(library):
    x = ca.SX.sym("x")
    with pytest.raises(CompilationError, match="no C for CasADi's operation"):
        library.compile_function(ca.Function("floored", [x], [ca.floor(x)]))


def test_unknown_operations_are_an_error_of_the_writer_too():
    x = ca.SX.sym("x")
    with pytest.raises(c_source.UnknownOperationError, match="floored"):
        c_source.source([ca.Function("floored", [x], [ca.floor(x)])])


def test_several_functions_share_one_source_and_say_what_they_take_and_give(tmp_path):
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    first = ca.Function("first", [x, y], [ca.jacobian(x[0] * x[2] * y, x)])
    second = ca.Function("second", [y], [ca.sumsqr(y), ca.SX(2, 0)])
    (tmp_path / "code.c").write_text(c_source.source([first, second]))
    subprocess.run(["gcc", "-shared", "-fPIC", "code.c", "-o", "code.so", "-lm"], cwd=tmp_path, check=True)
    library = ctypes.CDLL(str(tmp_path / "code.so"))
    ours = CompiledFunction(library, "first")
    pattern = first.sparsity_out(0)
    np.testing.assert_array_equal(ours.nonzeros(0), np.column_stack([pattern.row(), pattern.get_col()]))
    points = np.random.default_rng(0).normal(size=(5, 5))
    arguments = [points[:, :3].ravel().copy(), points[:, 3:].ravel().copy()]
    (nonzeros,) = evaluated(ours, 5, arguments, [pattern.nnz()])
    theirs = [np.array(first(point[:3], point[3:]).nonzeros()) for point in points]
    np.testing.assert_allclose(nonzeros.reshape(5, -1), theirs, rtol=1e-15)
    squares, empty = evaluated(CompiledFunction(library, "second"), 5, arguments[1:], [1, 0])
    np.testing.assert_allclose(squares, (points[:, 3:] ** 2).sum(axis=1), rtol=1e-15)
    assert empty.size == 0


def test_a_long_function_is_cut_into_blocks():
    x = ca.SX.sym("x", 50)
    long = ca.Function("long", [x], [ca.sumsqr(ca.sin(x)) + ca.sumsqr(ca.cos(x) * x)])
    blocks = re.findall(r"^static .*void long_\d+\(", c_source.source([long]), re.MULTILINE)
    assert len(blocks) == -(-long.n_instructions() // c_source._BLOCK)
