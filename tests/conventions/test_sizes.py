"""Modules, functions and signatures are of a size that a reader can hold in mind.

Cyclomatic complexity and numbers of arguments are the linter's to hold (C901, PLR0913).
"""

from __future__ import annotations

import ast
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
FILES = [*(TOP / "src").rglob("*.py"), *(TOP / "tests").rglob("*.py"), *(TOP / "examples").rglob("*.py")]
MODULE_MAX = 350  # lines
BODY_MAX = 45  # lines of a function, without its docstring


def body_length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function's body without its docstring."""
    documented = ast.get_docstring(function) is not None
    body = function.body[1:] if documented else function.body
    return function.end_lineno - body[0].lineno + 1 if body else 0


def test_no_module_is_too_long():
    lengths = {file.relative_to(TOP): len(file.read_text().splitlines()) for file in FILES}
    assert {str(file): length for file, length in lengths.items() if length > MODULE_MAX} == {}


def test_no_function_is_too_long():
    functions = [
        (f"{file.relative_to(TOP)}:{node.lineno} {node.name}", body_length(node))
        for file in FILES
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    assert {name: length for name, length in functions if length > BODY_MAX} == {}
