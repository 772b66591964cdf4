"""C source of CasADi functions that are evaluated at several points at once: each variable is a vector, one lane a point.

Derivatives of a stage are tens of thousands of operations without a branch, and the same at all stages of a kind. CasADi's
own generator writes them for one point; here four points share each instruction, which is three times as fast.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

LANES = 4  # points at once: more do not fit the cache, and leave more lanes empty
_BLOCK = 300  # operations in a C function: a compiler's time grows with the square of a function's length

_EXPRESSIONS = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0 / {0}",
}
_CALLS = {
    ca.OP_SQRT: "sqrt",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_TANH: "tanh",
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_FABS: "fabs",
    ca.OP_FMIN: "fmin",
    ca.OP_FMAX: "fmax",
}

_HEAD = f"""#include <math.h>

typedef double V __attribute__((vector_size({8 * LANES})));
#define LANES {LANES}

/* The rows of m numbers of up to LANES points; what is left of the lanes repeats the last. */
static void load(long m, long left, const double *from, V *restrict to) {{
  const double *rows[LANES];
  for (int l = 0; l < LANES; ++l) rows[l] = from + (l < left ? l : left - 1) * m;
  for (long i = 0; i < m; ++i) to[i] = (V){{{", ".join(f"rows[{lane}][i]" for lane in range(LANES))}}};
}}

static void store(long m, long left, const V *restrict from, double *restrict to) {{
  if (left >= LANES) {{
    for (long i = 0; i < m; ++i) {{
      {" ".join(f"to[{lane} * m + i] = from[i][{lane}];" for lane in range(LANES))}
    }}
  }} else {{
    for (int l = 0; l < left; ++l)
      for (long i = 0; i < m; ++i) to[l * m + i] = from[i][l];
  }}
}}
"""


class UnknownOperationError(ValueError):
    """A function has an operation that ``source`` writes no C for."""


def source(functions: Sequence[ca.Function]) -> str:
    """Return the C source of functions of SX.

    Each becomes ``void NAME(long n, const double *const *arguments, double *const *results)``, where each argument and
    result is the nonzeros at n points, one point after the other. ``const int NAME_inputs[]`` holds the number of
    arguments, then for each its number of nonzeros; ``const int NAME_nonzeros[]`` the number of results, then for each
    its number of nonzeros, then row and column of each.

    Args:
        functions: that are to become C, of SX expressions.

    Raises:
        UnknownOperationError: if one has an operation there is no C for.
    """
    return _HEAD + "".join(_function(f) for f in functions)


def _function(f: ca.Function) -> str:
    name = f.name()
    sizes = [
        *((f"a{i}", f.nnz_in(i)) for i in range(f.n_in())),
        *((f"r{i}", f.nnz_out(i)) for i in range(f.n_out())),
        ("w", f.sz_w()),
    ]
    parameters = ", ".join(f"V *restrict {array}" for array, _ in sizes)
    blocks = _blocks(f)
    lines = []
    for i, block in enumerate(blocks):
        lines += [f"static __attribute__((noinline)) void {name}_{i}({parameters}) {{", *block, "}"]
    nonzeros = [f.n_out()]
    for i in range(f.n_out()):
        pattern = f.sparsity_out(i)
        pairs = zip(pattern.row(), pattern.get_col(), strict=True)
        nonzeros += [pattern.nnz(), *(index for pair in pairs for index in pair)]
    lines += [
        f"const int {name}_inputs[] = {{{', '.join(map(str, [f.n_in(), *(f.nnz_in(i) for i in range(f.n_in()))]))}}};",
        f"const int {name}_nonzeros[] = {{{', '.join(map(str, nonzeros))}}};",
        f"void {name}(long n, const double *const *arguments, double *const *results) {{",
        *(f"  static __thread V {array}[{max(size, 1)}];" for array, size in sizes),
        "  for (long k = 0; k < n; k += LANES) {",
        *(f"    load({f.nnz_in(i)}, n - k, arguments[{i}] + k * {f.nnz_in(i)}, a{i});" for i in range(f.n_in())),
        *(f"    {name}_{i}({', '.join(array for array, _ in sizes)});" for i in range(len(blocks))),
        *(f"    store({f.nnz_out(i)}, n - k, r{i}, results[{i}] + k * {f.nnz_out(i)});" for i in range(f.n_out())),
        "  }",
        "}",
    ]
    return "\n" + "\n".join(lines) + "\n"


def _blocks(f: ca.Function) -> list[list[str]]:
    """Return the C statements of each block of operations; values that later blocks need go through the array ``w``."""
    count = f.n_instructions()
    made_by: dict[int, int] = {}  # place in CasADi's work vector ↦ the instruction whose value is there
    operands: list[list[int]] = []
    needed_in = [0] * count  # the last block
    for k in range(count):
        operation, places = f.instruction_id(k), f.instruction_input(k)
        if operation in (ca.OP_CONST, ca.OP_INPUT):
            places = []
        elif operation == ca.OP_OUTPUT:
            places = places[:1]
        operands.append([made_by[place] for place in places])
        for instruction in operands[k]:
            needed_in[instruction] = k // _BLOCK
        if operation != ca.OP_OUTPUT:
            made_by[f.instruction_output(k)[0]] = k
    blocks = []
    for first in range(0, count, _BLOCK):
        statements: list[str] = []
        fetched: set[int] = set()
        for k in range(first, min(first + _BLOCK, count)):
            for instruction in operands[k]:
                if instruction < first and instruction not in fetched:
                    fetched.add(instruction)
                    statements.append(f"  const V t{instruction} = w[{f.instruction_output(instruction)[0]}];")
            statements.append("  " + _statement(f, k, [f"t{instruction}" for instruction in operands[k]]))
            if needed_in[k] > k // _BLOCK:
                statements.append(f"  w[{f.instruction_output(k)[0]}] = t{k};")
        blocks.append(statements)
    return blocks


def _statement(f: ca.Function, k: int, operands: list[str]) -> str:
    """Return CasADi's instruction ``k`` as a C statement that leaves its value in the variable ``tk``."""
    operation = f.instruction_id(k)
    if operation == ca.OP_CONST:
        constant = float(f.instruction_constant(k)).hex().replace("inf", "INFINITY").replace("nan", "NAN")
        return f"const V t{k} = {{{', '.join([constant] * LANES)}}};"
    if operation == ca.OP_INPUT:
        argument, entry = f.instruction_input(k)
        return f"const V t{k} = a{argument}[{entry}];"
    if operation == ca.OP_OUTPUT:
        result, entry = f.instruction_output(k)
        return f"r{result}[{entry}] = {operands[0]};"
    if operation in _EXPRESSIONS:
        return f"const V t{k} = {_EXPRESSIONS[operation].format(*operands)};"
    if operation in _CALLS:
        arguments = ", ".join(f"{operand}[l]" for operand in operands)
        return f"V t{k}; for (int l = 0; l < LANES; ++l) t{k}[l] = {_CALLS[operation]}({arguments});"
    raise UnknownOperationError(f"{f.name()}: no C for CasADi's operation {operation}")
