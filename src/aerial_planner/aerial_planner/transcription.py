"""Multi-stage optimal control problems, written one stage at a time and solved by FATROP or IPOPT.

A *stage kind* holds the CasADi expressions of one knot: next state, cost, constraints. A *problem* is a sequence of
stage kinds. Derivatives (exact Hessian included) are made once per kind and mapped over the knots of that kind, so that
building a problem costs as much as differentiating a handful of knots, and a built problem serves every request of the
same sequence: all numbers enter as stage parameters and bounds.

    min  Σ_k cost_k(x_k, u_k, p_k)
    s.t. x_k+1 = next_k(x_k, u_k, p_k),   lower_k ≤ constraint_k(x_k, u_k, p_k) ≤ upper_k ,  bounds on x_k, u_k .
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from aerial_planner.compiled import FunctionLibrary
from aerial_planner.stage import StageData, StageFunctions, StageKind

_NLP_GRAD_OUTPUTS = ["f", "g", "grad_gamma_x", "grad_gamma_p"]
_ACTIVE = 1e-3  # an inequality nearer to its bound than this holds the optimum back


@dataclass(frozen=True, kw_only=True)
class Solution:
    """What a solver returned, knot by knot."""

    x: list[np.ndarray]
    u: list[np.ndarray]
    cost: float
    iterations: int
    status: str
    converged: bool
    max_violation: float  # of any constraint or bound
    binding: tuple[str, ...]  # the inequalities that hold the optimum back at most knots, most first


@dataclass(frozen=True, kw_only=True)
class SolverOptions:
    """How to solve; the defaults suit a good first guess."""

    solver: str = "fatrop"  # or "ipopt" (with MUMPS)
    tolerance: float = 1e-4  # on optimality and constraints
    max_iterations: int = 100
    initial_barrier: float = 1.0  # μ_0 of the interior-point method: high, where the guess is outside of the limits
    barrier_accuracy: float = 100.0  # how far a barrier problem is solved before the next, in multiples of μ
    bound_distance: float = 0.3  # of the guess from its bounds, as a share of their range (or of 1, if smaller)


class Problem:
    """A sequence of stage kinds, built once and solved for many requests."""

    def __init__(
        self,
        kinds: Sequence[StageKind],
        options: SolverOptions = SolverOptions(),
        library: FunctionLibrary | None = None,
    ) -> None:
        self.kinds = list(kinds)
        self.options = options
        self._layout = _Layout(self.kinds)
        self._library = library
        self._solver = self._build()

    def solve(self, stages: Sequence[StageData]) -> Solution:
        """Return the optimum from the stages' guess; check ``converged`` and ``max_violation`` before using it."""
        w_0, p, lower_w, upper_w = _flat(stages)
        lower_g, upper_g = self._layout.lower, self._layout.upper
        result = self._solver(x0=w_0, p=p, lbx=lower_w, ubx=upper_w, lbg=lower_g, ubg=upper_g)
        stats = self._solver.stats()
        w, g = np.asarray(result["x"]).ravel(), np.asarray(result["g"]).ravel()
        finite = bool(np.all(np.isfinite(w)))
        x, u = self._layout.split(w)
        at_bound = ~self._layout.equality & (np.minimum(g - lower_g, upper_g - g) < _ACTIVE)
        active = Counter(label for label, hit in zip(self._layout.labels, at_bound, strict=True) if hit)
        return Solution(
            x=x,
            u=u,
            cost=float(result["f"]),
            iterations=int(stats.get("iter_count", 0)),
            status=str(stats.get("return_status", stats.get("unified_return_status", ""))),
            converged=bool(stats["success"]) and finite,
            max_violation=_excess(w, lower_w, upper_w, g, lower_g, upper_g) if finite else float("inf"),
            binding=tuple(label for label, _ in active.most_common()),
        )

    def violation(self, stages: Sequence[StageData]) -> float:
        """Return by how much the stages' guess violates any constraint or bound."""
        w, p, lower_w, upper_w = _flat(stages)
        g = np.asarray(self._solver.get_function("nlp_g")(w, p)).ravel()
        return _excess(w, lower_w, upper_w, g, self._layout.lower, self._layout.upper)

    def functions(self) -> dict[str, ca.Function]:
        """Return the problem's functions and derivatives, under the names CasADi's interface to the solver looks for."""
        return self._layout.functions(self.options.solver, self._functions_of)

    def _functions_of(self, kind: StageKind) -> StageFunctions:
        compiled = self._library.load(kind) if self._library else None
        return compiled or kind.functions()

    def _build(self) -> ca.Function:
        layout = self._layout
        functions = self.functions()
        w, p = layout.w, layout.p
        nlp = {"x": w, "p": p, "f": functions["nlp_f"](w, p), "g": functions["nlp_g"](w, p)}
        common = {"print_time": False, "cache": functions, "error_on_fail": False, "calc_lam_p": False}
        options = self.options
        interior_point = {
            "print_level": 0,
            "tol": options.tolerance,
            "max_iter": options.max_iterations,
            "mu_init": options.initial_barrier,
            "barrier_tol_factor": options.barrier_accuracy,
            "bound_push": options.bound_distance,
            "bound_frac": options.bound_distance,
        }
        if options.solver == "fatrop":
            settings = {
                "structure_detection": "manual",
                "N": len(self.kinds) - 1,
                "nx": layout.nx,
                "nu": layout.nu,
                "ng": layout.ng,
                "equality": layout.equality.tolist(),
                "fatrop": interior_point,
            }
        else:
            settings = {"ipopt": {**interior_point, "sb": "yes", "linear_solver": "mumps"}}
        return ca.nlpsol("kino_dynamic", options.solver, nlp, {**common, **settings})


def _flat(stages: Sequence[StageData]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return guess, parameters and bounds of all knots in one row each."""
    guess = [part for s in stages for part in (s.x, s.u)]
    lower = [part for s in stages for part in (s.x_min, s.u_min)]
    upper = [part for s in stages for part in (s.x_max, s.u_max)]
    return np.concatenate(guess), np.concatenate([s.p for s in stages]), np.concatenate(lower), np.concatenate(upper)


def _excess(
    w: np.ndarray, lower_w: np.ndarray, upper_w: np.ndarray, g: np.ndarray, lower_g: np.ndarray, upper_g: np.ndarray
) -> float:
    """Return the largest violation of bounds on the variables ``w`` and on the constraints ``g``."""
    return float(np.max(np.concatenate([lower_w - w, w - upper_w, lower_g - g, g - upper_g]), initial=0.0))


@dataclass
class _Layout:
    """Where each knot's variables, parameters and constraints stand in the flat problem FATROP reads.

    Variables: x_0, u_0, x_1, u_1, …; constraints: dynamics 0 (x_1 − next_0), constraints 0, dynamics 1, ….
    """

    kinds: list[StageKind]
    nx: list[int] = field(init=False)
    nu: list[int] = field(init=False)
    ng: list[int] = field(init=False)

    def __post_init__(self) -> None:
        self.nx = [kind.x.numel() for kind in self.kinds]
        self.nu = [kind.u.numel() for kind in self.kinds]
        self.ng = [kind.constraints.numel() for kind in self.kinds]
        for kind, following in zip(self.kinds[:-1], self.kinds[1:], strict=True):
            if kind.n_next != following.x.numel():
                raise ValueError(
                    f"stage {kind.name} leads to {kind.n_next} states, {following.name} has {following.x.numel()}"
                )
        n_z = np.array([x + u for x, u in zip(self.nx, self.nu, strict=True)])
        n_p = np.array([kind.p.numel() for kind in self.kinds])
        n_rows = np.array([kind.n_next + ng for kind, ng in zip(self.kinds, self.ng, strict=True)])
        self.z_0, self.p_0, self.row_0 = (np.concatenate([[0], np.cumsum(n)]) for n in (n_z, n_p, n_rows))
        self.w = ca.MX.sym("w", int(self.z_0[-1]))
        self.p = ca.MX.sym("p", int(self.p_0[-1]))
        rows = [(np.zeros(kind.n_next), kind.lower, kind.upper) for kind in self.kinds]
        self.lower = np.concatenate([np.concatenate([zero, low]) for zero, low, _ in rows])
        self.upper = np.concatenate([np.concatenate([zero, up]) for zero, _, up in rows])
        self.equality = self.lower == self.upper
        self.labels = [label for kind in self.kinds for label in ("dynamics",) * kind.n_next + kind.labels]

    def split(self, w: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the states and the controls of each knot."""
        x = [w[start : start + n] for start, n in zip(self.z_0, self.nx, strict=False)]
        u = [w[start + nx : start + nx + nu] for start, nx, nu in zip(self.z_0, self.nx, self.nu, strict=False)]
        return x, u

    def groups(self) -> list[tuple[StageKind, list[int]]]:
        """Return each kind with the knots it stands at."""
        found: dict[int, tuple[StageKind, list[int]]] = {}
        for k, kind in enumerate(self.kinds):
            found.setdefault(id(kind), (kind, []))[1].append(k)
        return list(found.values())

    def functions(self, solver: str, functions_of: Callable[[StageKind], StageFunctions]) -> dict[str, ca.Function]:
        """Return the problem's functions with the names and outputs that CasADi's interface to ``solver`` looks for."""
        w, p = self.w, self.p
        n_w, n_g = w.numel(), len(self.lower)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", n_g)
        cost = ca.MX(0)
        g, gradient, jacobian, lagrangian_gradient, hessian = ([] for _ in range(5))  # lists of _Blocks
        for kind, knots in self.groups():
            n, stage = len(knots), functions_of(kind)
            z_0, row_0 = self.z_0[knots], self.row_0[knots]
            row_g = row_0 + kind.n_next
            z, parameters = _gather(w, z_0, kind.z.numel()), _gather(p, self.p_0[knots], kind.p.numel())
            lam = (_gather(lam_g, row_0, kind.n_next), _gather(lam_g, row_g, kind.constraints.numel()))
            f, following, values = stage.values.map(n)(z, parameters)
            J_x, J_g = stage.jacobian.map(n)(z, parameters)
            lag, H = stage.hessian.map(n)(z, parameters, ca.repmat(lam_f, 1, n), *lam)
            column = np.zeros(n, dtype=int)
            cost += ca.sum2(f)
            g += [_Blocks(stage.values.sparsity_out(1), -following, row_0, column)]
            g += [_Blocks(stage.values.sparsity_out(2), values, row_g, column)]
            gradient += [_Blocks(stage.gradient.sparsity_out(0), stage.gradient.map(n)(z, parameters), z_0, column)]
            jacobian += [_Blocks(stage.jacobian.sparsity_out(0), J_x, row_0, z_0)]
            jacobian += [_Blocks(stage.jacobian.sparsity_out(1), J_g, row_g, z_0)]
            lagrangian_gradient += [_Blocks(stage.hessian.sparsity_out(0), lag, z_0, column)]
            hessian += [_Blocks(stage.hessian.sparsity_out(1), H, z_0, z_0)]
        for k, kind in enumerate(self.kinds[:-1]):  # the next knot's state, with coefficient 1
            x_next = w[int(self.z_0[k + 1]) : int(self.z_0[k + 1]) + kind.n_next]
            at_row, at_column = self.row_0[k : k + 1], self.z_0[k + 1 : k + 2]
            g += [_Blocks(ca.Sparsity.dense(kind.n_next, 1), x_next, at_row, np.zeros(1, dtype=int))]
            jacobian += [_Blocks(ca.Sparsity.diag(kind.n_next), ca.MX.eye(kind.n_next), at_row, at_column)]
            lam_x = lam_g[int(self.row_0[k]) : int(self.row_0[k]) + kind.n_next]
            to_rows = self.z_0[k + 1 : k + 2]
            lagrangian_gradient += [_Blocks(ca.Sparsity.dense(kind.n_next, 1), lam_x, to_rows, np.zeros(1, dtype=int))]
        g_all = _assembled(g, n_g, 1)
        grad_f, H_all = _assembled(gradient, n_w, 1), _assembled(hessian, n_w, n_w)
        outputs = {
            "nlp_f": ([w, p], [cost], ["f"]),
            "nlp_g": ([w, p], [g_all], ["g"]),
            "nlp_jac_g": ([w, p], [g_all, _assembled(jacobian, n_g, n_w)], ["g", "jac_g_x"]),
        }
        multipliers = [w, p, lam_f, lam_g]
        grad_lagrangian = _assembled(lagrangian_gradient, n_w, 1)
        # CasADi wants this one at hand for multipliers of parameters; they are not asked for (calc_lam_p).
        outputs["nlp_grad"] = (multipliers, [cost, g_all, grad_lagrangian, ca.MX(p.numel(), 1)], _NLP_GRAD_OUTPUTS)
        if solver == "fatrop":
            outputs["nlp_grad_f"] = ([w, p], [grad_f], ["grad_f_x"])
            outputs["nlp_hess_l"] = (multipliers, [grad_lagrangian, H_all], ["grad_gamma_x", "hess_gamma_x_x"])
        else:
            outputs["nlp_grad_f"] = ([w, p], [cost, grad_f], ["f", "grad_f_x"])
            outputs["nlp_hess_l"] = (multipliers, [ca.triu(H_all)], ["triu_hess_gamma_x_x"])
        inputs = ["x", "p", "lam_f", "lam_g"]
        return {
            name: ca.Function(name, arguments, results, inputs[: len(arguments)], result_names)
            for name, (arguments, results, result_names) in outputs.items()
        }


@dataclass(frozen=True)
class _Blocks:
    """Equally shaped sparse blocks, side by side in ``values``, and where each one's corner stands in a matrix."""

    sparsity: ca.Sparsity  # of one block
    values: ca.MX
    row_0: np.ndarray
    column_0: np.ndarray


def _gather(vector: ca.MX, starts: np.ndarray, n: int) -> ca.MX:
    """Return ``(n, len(starts))``: the n entries from each start, as columns."""
    if n == 0:
        return ca.MX(0, len(starts))
    indices = (np.asarray(starts)[:, None] + np.arange(n)).ravel().tolist()
    return ca.reshape(vector[indices], n, len(starts))


def _assembled(blocks: Sequence[_Blocks], n_rows: int, n_columns: int) -> ca.MX:
    """Return the sparse matrix that holds all blocks; entries that several blocks share are added."""
    rows, columns, values = [], [], []
    for block in blocks:
        if block.sparsity.nnz() == 0:
            continue
        rows.append((block.row_0[:, None] + np.array(block.sparsity.row(), dtype=int)).ravel())
        columns.append((block.column_0[:, None] + np.array(block.sparsity.get_col(), dtype=int)).ravel())
        side_by_side = ca.repmat(block.sparsity, 1, len(block.row_0))
        values.append(ca.vec(ca.project(block.values, side_by_side)).nz[:])
    if not values:
        return ca.MX(n_rows, n_columns)
    rows, columns = np.concatenate(rows), np.concatenate(columns)
    nonzeros = ca.vertcat(*values)
    order = np.lexsort((rows, columns))
    keys = columns[order] * n_rows + rows[order]
    first = np.concatenate([[True], keys[1:] != keys[:-1]])
    sparsity = ca.Sparsity.triplet(n_rows, n_columns, rows[order][first].tolist(), columns[order][first].tolist())
    if np.all(first):
        return ca.MX(sparsity, nonzeros[order.tolist()])
    gather = ca.Sparsity.triplet(int(first.sum()), len(order), (np.cumsum(first) - 1).tolist(), order.tolist())
    return ca.MX(sparsity, ca.mtimes(ca.DM(gather, 1), nonzeros))
