"""A sequence of stage kinds as one flat nonlinear program for CasADi's interfaces to FATROP and IPOPT.

CasADi's own derivatives of a flat problem take seconds to make. Here those of each kind are mapped over its knots and
scattered into the flat matrices, and handed to ``nlpsol`` through its function cache.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from aerial_planner.ocp.options import Outcome, SolverName, SolverOptions
from aerial_planner.ocp.stage import StageKind

_NLP_GRAD_OUTPUTS = ["f", "g", "grad_gamma_x", "grad_gamma_p"]


class FlatProgram:
    """The flat program of one sequence of stage kinds.

    Variables: x_0, u_0, x_1, u_1, …; constraints: dynamics 0 (x_1 − next_0), constraints 0, dynamics 1, ….

    Args:
        kinds: of each knot.
        options: of the solver, FATROP or IPOPT.
    """

    def __init__(self, kinds: Sequence[StageKind], options: SolverOptions) -> None:
        self.kinds = list(kinds)
        self._nx = [kind.x.numel() for kind in kinds]
        self._nu = [kind.u.numel() for kind in kinds]
        self._ng = [kind.constraints.numel() for kind in kinds]
        n_p = [kind.p.numel() for kind in kinds]
        n_rows = [kind.n_next + ng for kind, ng in zip(self.kinds, self._ng, strict=True)]
        n_z = np.add(self._nx, self._nu)
        self._z_0, self._p_0, self._row_0 = (np.concatenate([[0], np.cumsum(n)]) for n in (n_z, n_p, n_rows))
        rows = [(np.zeros(kind.n_next), kind.lower, kind.upper) for kind in self.kinds]
        self._lower = np.concatenate([np.concatenate([zero, low]) for zero, low, _ in rows])
        self._upper = np.concatenate([np.concatenate([zero, up]) for zero, _, up in rows])
        self._w, self._p = ca.MX.sym("w", int(self._z_0[-1])), ca.MX.sym("p", int(self._p_0[-1]))
        self._name = SolverName(options.solver)
        self.functions = self._make_functions()  # under the names that CasADi's interface looks for
        self._solver = self._make_solver(options)

    def solve(self, w: np.ndarray, p: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Outcome:
        """Return where the solver ends from ``w``; arguments as of ``InteriorPoint.solve``."""
        result = self._solver(x0=w, p=p, lbx=lower, ubx=upper, lbg=self._lower, ubg=self._upper)
        stats = self._solver.stats()
        return Outcome(
            w=np.asarray(result["x"]).ravel(),
            cost=float(result["f"]),
            iterations=int(stats.get("iter_count", 0)),
            status=str(stats.get("return_status", stats.get("unified_return_status", ""))),
            converged=bool(stats["success"]),
        )

    def constraints(self, w: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return for each knot the misses of its dynamics, then its constraints, in one row."""
        return np.asarray(self.functions["nlp_g"](w, p)).ravel()

    def _make_solver(self, options: SolverOptions) -> ca.Function:
        functions, w, p = self.functions, self._w, self._p
        nlp = {"x": w, "p": p, "f": functions["nlp_f"](w, p), "g": functions["nlp_g"](w, p)}
        common = {"print_time": False, "cache": functions, "error_on_fail": False, "calc_lam_p": False}
        interior_point = {
            "print_level": 0,
            "tol": options.tolerance,
            "max_iter": options.max_iterations,
            "mu_init": options.initial_barrier,
            "barrier_tol_factor": options.barrier_accuracy,
            "bound_push": options.bound_distance,
            "bound_frac": options.bound_distance,
        }
        if self._name is SolverName.FATROP:
            settings = {
                "structure_detection": "manual",
                "N": len(self.kinds) - 1,
                "nx": self._nx,
                "nu": self._nu,
                "ng": self._ng,
                "equality": (self._lower == self._upper).tolist(),
                "fatrop": interior_point,
            }
        else:
            settings = {"ipopt": {**interior_point, "sb": "yes", "linear_solver": "mumps"}}
        return ca.nlpsol("kino_dynamic", self._name.value, nlp, {**common, **settings})

    def _groups(self) -> list[tuple[StageKind, list[int]]]:
        """Return each kind with the knots it stands at."""
        found: dict[int, tuple[StageKind, list[int]]] = {}
        for k, kind in enumerate(self.kinds):
            found.setdefault(id(kind), (kind, []))[1].append(k)
        return list(found.values())

    def _make_functions(self) -> dict[str, ca.Function]:
        w, p = self._w, self._p
        n_w, n_g = w.numel(), len(self._lower)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", n_g)
        cost = ca.MX(0)
        g, gradient, jacobian, lagrangian_gradient, hessian = ([] for _ in range(5))  # lists of _Blocks
        for kind, knots in self._groups():
            n, stage = len(knots), kind.nlp_functions()
            z_0, row_0 = self._z_0[knots], self._row_0[knots]
            row_g = row_0 + kind.n_next
            z, parameters = _gather(w, z_0, kind.z.numel()), _gather(p, self._p_0[knots], kind.p.numel())
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
            x_next = w[int(self._z_0[k + 1]) : int(self._z_0[k + 1]) + kind.n_next]
            at_row, at_column = self._row_0[k : k + 1], self._z_0[k + 1 : k + 2]
            g += [_Blocks(ca.Sparsity.dense(kind.n_next, 1), x_next, at_row, np.zeros(1, dtype=int))]
            jacobian += [_Blocks(ca.Sparsity.diag(kind.n_next), ca.MX.eye(kind.n_next), at_row, at_column)]
            lam_x = lam_g[int(self._row_0[k]) : int(self._row_0[k]) + kind.n_next]
            to_rows = self._z_0[k + 1 : k + 2]
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
        if self._name is SolverName.FATROP:
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
