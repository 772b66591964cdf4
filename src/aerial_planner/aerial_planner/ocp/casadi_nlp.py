"""A sequence of stage kinds as one flat nonlinear program for CasADi's interfaces to FATROP and IPOPT.

CasADi's own derivatives of a flat problem take seconds to make. Here those of each kind are mapped over its stages and
scattered into the flat matrices, and handed to ``nlpsol`` through its function cache.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from aerial_planner.ocp.options import Outcome, SolverName, SolverOptions
from aerial_planner.ocp.ragged import starts_of
from aerial_planner.ocp.stage import StageKind

_NLP_GRAD_OUTPUTS = ["f", "g", "grad_gamma_x", "grad_gamma_p"]


class FlatProgram:
    """The flat program of one sequence of stage kinds.

    Variables: x_0, u_0, x_1, u_1, …; constraints: dynamics 0 (x_1 − next_0), constraints 0, dynamics 1, ….

    Args:
        kinds: stage kind of each stage.
        options: of the solver, FATROP or IPOPT.

    Attributes:
        functions: the program's functions and derivatives, under the names that CasADi's interface looks for.
    """

    def __init__(self, kinds: Sequence[StageKind], options: SolverOptions) -> None:
        self.kinds = list(kinds)
        self._nx = [kind.x.numel() for kind in kinds]
        self._nu = [kind.u.numel() for kind in kinds]
        self._ng = [kind.constraints.numel() for kind in kinds]
        self._z_0 = starts_of(np.add(self._nx, self._nu))
        self._p_0 = starts_of([kind.p.numel() for kind in kinds])
        self._row_0 = starts_of([kind.n_next + ng for kind, ng in zip(self.kinds, self._ng, strict=True)])
        rows = [(np.zeros(kind.n_next), kind.lower, kind.upper) for kind in self.kinds]
        self._lower = np.concatenate([np.concatenate([zero, low]) for zero, low, _ in rows])
        self._upper = np.concatenate([np.concatenate([zero, up]) for zero, _, up in rows])
        self._w, self._p = ca.MX.sym("w", int(self._z_0[-1])), ca.MX.sym("p", int(self._p_0[-1]))
        self._name = SolverName(options.solver)
        self.functions = self._make_functions()
        self._solver = self._make_solver(options)

    def solve(self, w: np.ndarray, p: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Outcome:
        """Return where the solver ends.

        Args:
            w: guess ``(n_w,)``.
            p: parameters of all stages ``(n_p,)``.
            lower: bounds of w ``(n_w,)``.
            upper: bounds of w ``(n_w,)``.
        """
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
        """Return for each stage the misses of its dynamics, then its constraints, in one row."""
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
        return ca.nlpsol("flat_program", self._name.value, nlp, {**common, **settings})

    def _groups(self) -> list[tuple[StageKind, list[int]]]:
        """Return each kind with the stages it stands at."""
        found: dict[int, tuple[StageKind, list[int]]] = {}
        for k, kind in enumerate(self.kinds):
            found.setdefault(id(kind), (kind, []))[1].append(k)
        return list(found.values())

    def _make_functions(self) -> dict[str, ca.Function]:
        w, p = self._w, self._p
        n_w, n_g = w.numel(), len(self._lower)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", n_g)
        parts = _Parts()
        for kind, stages in self._groups():
            self._add_kind(parts, kind, stages, lam_f, lam_g)
        for k in range(len(self.kinds) - 1):
            self._add_next_state(parts, k, lam_g)
        cost, g = parts.cost, _assembled(parts.g, n_g, 1)
        gradient, H = _assembled(parts.gradient, n_w, 1), _assembled(parts.hessian, n_w, n_w)
        lagrangian, multipliers = _assembled(parts.lagrangian, n_w, 1), [w, p, lam_f, lam_g]
        outputs = {
            "nlp_f": ([w, p], [cost], ["f"]),
            "nlp_g": ([w, p], [g], ["g"]),
            "nlp_jac_g": ([w, p], [g, _assembled(parts.jacobian, n_g, n_w)], ["g", "jac_g_x"]),
            # CasADi looks for this one for the sake of parameters' multipliers, which are not asked for (calc_lam_p).
            "nlp_grad": (multipliers, [cost, g, lagrangian, ca.MX(p.numel(), 1)], _NLP_GRAD_OUTPUTS),
        }
        if self._name is SolverName.FATROP:
            outputs["nlp_grad_f"] = ([w, p], [gradient], ["grad_f_x"])
            outputs["nlp_hess_l"] = (multipliers, [lagrangian, H], ["grad_gamma_x", "hess_gamma_x_x"])
        else:
            outputs["nlp_grad_f"] = ([w, p], [cost, gradient], ["f", "grad_f_x"])
            outputs["nlp_hess_l"] = (multipliers, [ca.triu(H)], ["triu_hess_gamma_x_x"])
        inputs = ["x", "p", "lam_f", "lam_g"]
        return {
            name: ca.Function(name, arguments, results, inputs[: len(arguments)], result_names)
            for name, (arguments, results, result_names) in outputs.items()
        }

    def _add_kind(self, parts: _Parts, kind: StageKind, stages: list[int], lam_f: ca.MX, lam_g: ca.MX) -> None:
        """Add the functions of a kind, mapped over its stages."""
        n, functions = len(stages), kind.nlp_functions()
        z_0, row_0 = self._z_0[stages], self._row_0[stages]
        row_g, column = row_0 + kind.n_next, np.zeros(n, dtype=int)
        z, p = _gather(self._w, z_0, kind.z.numel()), _gather(self._p, self._p_0[stages], kind.p.numel())
        lam = (_gather(lam_g, row_0, kind.n_next), _gather(lam_g, row_g, kind.constraints.numel()))
        f, following, values = functions.values.map(n)(z, p)
        J_x, J_g = functions.jacobian.map(n)(z, p)
        lagrangian, H = functions.hessian.map(n)(z, p, ca.repmat(lam_f, 1, n), *lam)
        parts.cost += ca.sum2(f)
        parts.g += [
            _Blocks(functions.values.sparsity_out(1), -following, row_0, column),
            _Blocks(functions.values.sparsity_out(2), values, row_g, column),
        ]
        parts.gradient += [_Blocks(functions.gradient.sparsity_out(0), functions.gradient.map(n)(z, p), z_0, column)]
        parts.jacobian += [
            _Blocks(functions.jacobian.sparsity_out(0), J_x, row_0, z_0),
            _Blocks(functions.jacobian.sparsity_out(1), J_g, row_g, z_0),
        ]
        parts.lagrangian += [_Blocks(functions.hessian.sparsity_out(0), lagrangian, z_0, column)]
        parts.hessian += [_Blocks(functions.hessian.sparsity_out(1), H, z_0, z_0)]

    def _add_next_state(self, parts: _Parts, k: int, lam_g: ca.MX) -> None:
        """Add what the state after stage ``k`` contributes to the stage's dynamics: x_next, with coefficient 1."""
        n, at_row, at_column = self.kinds[k].n_next, self._row_0[k : k + 1], self._z_0[k + 1 : k + 2]
        x_next = self._w[int(at_column[0]) : int(at_column[0]) + n]
        lam_x = lam_g[int(at_row[0]) : int(at_row[0]) + n]
        dense, zero = ca.Sparsity.dense(n, 1), np.zeros(1, dtype=int)
        parts.g += [_Blocks(dense, x_next, at_row, zero)]
        parts.jacobian += [_Blocks(ca.Sparsity.diag(n), ca.MX.eye(n), at_row, at_column)]
        parts.lagrangian += [_Blocks(dense, lam_x, at_column, zero)]


@dataclass(frozen=True)
class _Blocks:
    """Equally shaped sparse blocks, side by side in ``values``, and where each one's corner stands in a matrix."""

    sparsity: ca.Sparsity  # of one block
    values: ca.MX
    row_0: np.ndarray
    column_0: np.ndarray


@dataclass
class _Parts:
    """Of what the flat program's vectors and matrices are assembled."""

    cost: ca.MX = field(default_factory=lambda: ca.MX(0))
    g: list[_Blocks] = field(default_factory=list)
    gradient: list[_Blocks] = field(default_factory=list)
    jacobian: list[_Blocks] = field(default_factory=list)
    lagrangian: list[_Blocks] = field(default_factory=list)  # its gradient
    hessian: list[_Blocks] = field(default_factory=list)


def _gather(vector: ca.MX, starts: np.ndarray, n: int) -> ca.MX:
    """Return ``(n, len(starts))``: the n entries from each start, as columns."""
    if n == 0:
        return ca.MX(0, len(starts))
    indices = (np.asarray(starts)[:, None] + np.arange(n)).ravel().tolist()
    return ca.reshape(vector[indices], n, len(starts))


def _assembled(blocks: Sequence[_Blocks], n_rows: int, n_columns: int) -> ca.MX:
    """Return the sparse matrix that holds all blocks; entries that several blocks share are added."""
    filled = [block for block in blocks if block.sparsity.nnz() > 0]
    if not filled:
        return ca.MX(n_rows, n_columns)
    rows = np.concatenate([_all_of(block.row_0, block.sparsity.row()) for block in filled])
    columns = np.concatenate([_all_of(block.column_0, block.sparsity.get_col()) for block in filled])
    values = [ca.project(block.values, ca.repmat(block.sparsity, 1, len(block.row_0))) for block in filled]
    nonzeros = ca.vertcat(*(ca.vec(value).nz[:] for value in values))
    order = np.lexsort((rows, columns))
    keys = columns[order] * n_rows + rows[order]
    first = np.concatenate([[True], keys[1:] != keys[:-1]])
    sparsity = ca.Sparsity.triplet(n_rows, n_columns, rows[order][first].tolist(), columns[order][first].tolist())
    if np.all(first):
        return ca.MX(sparsity, nonzeros[order.tolist()])
    gather = ca.Sparsity.triplet(int(first.sum()), len(order), (np.cumsum(first) - 1).tolist(), order.tolist())
    return ca.MX(sparsity, ca.mtimes(ca.DM(gather, 1), nonzeros))


def _all_of(corners: np.ndarray, places: Sequence[int]) -> np.ndarray:
    """Return the rows, or columns, of all entries of blocks whose corners these are, block by block."""
    entries: np.ndarray = corners[:, None] + np.array(places, dtype=int)
    return entries.ravel()
