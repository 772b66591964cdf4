"""Linear-quadratic problems with equality constraints, stage by stage, solved exactly in time linear in their number.

    min  Σ_k ½ y_kᵀ Q_k y_k + q_kᵀ y_k ,   y_k = (u_k, x_k)
    s.t. x_k+1 = F_k y_k + f_k ,   C_k y_k + c_k = 0 .

Each Newton step of an interior-point method is one: Rao, Wright and Rawlings, *Application of interior-point methods to model
predictive control*, Journal of Optimization Theory and Applications 99 (1998). The recursion is Riccati's, extended to constraints as
by Vanroye, Sathya, De Schutter and Decré, *FATROP: A fast constrained optimal control problem solver*, IROS 2023: from the
last stage backward, constraints that contain controls eliminate as many of them; what constraints say of the state alone,
the constraint-to-go H x + h = 0, is handed to the stage before. Products of dense matrices are BLAS's (through SciPy), those
with F, which is sparse, loops: a stage of a quadruped takes 0.03 ms. ``elimination`` has the dense algebra of a stage.

Stages differ in size; their matrices lie in arrays with an entry for each stage that is as large as the largest one needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aerial_model.numerics.jit import compiled
from aerial_planner.ocp.elimination import (
    add_cost_to_go,
    add_product,
    constraint_to_go,
    minimize,
    quadratic,
    reduce_rows,
    solved_for_first,
    store,
    substitute,
    write_constraints,
    write_next_constraints,
)


class Sizes(NamedTuple):
    """How much each stage has of everything."""

    nx: np.ndarray  # (K,) states
    nu: np.ndarray  # (K,) controls
    nc: np.ndarray  # (K,) equality constraints
    n_links: np.ndarray  # (K,) nonzeros of F


class Coefficients(NamedTuple):
    """Matrices of all stages, columns in the order y = (u, x); what a stage does not need of them is not read."""

    Q: np.ndarray  # (K, n_y, n_y) Hessian of the cost
    q: np.ndarray  # (K, n_y) its gradient at 0
    links: np.ndarray  # (K, n_F, 2) row and column of each nonzero of F
    F: np.ndarray  # (K, n_F) the nonzeros themselves
    f: np.ndarray  # (K, n_x) offset of the next state
    C: np.ndarray  # (K, n_c, n_y) Jacobian of the constraints
    c: np.ndarray  # (K, n_c) their offset

    def after_first(self) -> Coefficients:
        """Return those of all stages but the first, in memory that is shared."""
        return Coefficients(*(array[1:] for array in self))


class Optimum(NamedTuple):
    """Solution of a linear-quadratic problem and its multipliers."""

    y: np.ndarray  # (K, n_y)
    dynamics: np.ndarray  # (K, n_x) of x_k+1 − F_k y_k − f_k = 0
    constraints: np.ndarray  # (K, n_c) of C_k y_k + c_k = 0

    def after_first(self) -> Optimum:
        """Return that of all stages but the first, in memory that is shared."""
        return Optimum(*(array[1:] for array in self))


class Factor(NamedTuple):
    """What the backward recursion finds out about each stage; m rows are its constraints and the next state's.

    The controls are ordered (eliminated ones, free ones); 1 stands for the constant.
    """

    P: np.ndarray  # (K, n_x, n_x + 1) Hessian of the cost-to-go, and its gradient at 0
    H: np.ndarray  # (K, m, n_x + 1) constraint-to-go [H h]
    n_h: np.ndarray  # (K,) number of rows of H
    H_rows: np.ndarray  # (K, m) which of the stage's reduced rows these are
    T: np.ndarray  # (K, m, m) the stage's rows ↦ reduced rows
    rank: np.ndarray  # (K,) number of eliminated controls
    order: np.ndarray  # (K, n_y) original place of each ordered control
    eliminated: np.ndarray  # (K, n_y, n_y + 1) (free controls, x, 1) ↦ minus the eliminated controls
    slope: np.ndarray  # (K, n_y, n_y + 1) (free controls, x, 1) ↦ the cost's gradient by the eliminated controls
    gain: np.ndarray  # (K, n_y, n_x + 1) (x, 1) ↦ free controls

    @staticmethod
    def zeros(K: int, n_x: int, n_y: int, m: int) -> Factor:
        """Return memory for K stages of at most these sizes."""
        return Factor(
            P=np.zeros((K, n_x, n_x + 1)),
            H=np.zeros((K, m, n_x + 1)),
            n_h=np.zeros(K, dtype=np.int64),
            H_rows=np.zeros((K, m), dtype=np.int64),
            T=np.zeros((K, m, m)),
            rank=np.zeros(K, dtype=np.int64),
            order=np.zeros((K, n_y), dtype=np.int64),
            eliminated=np.zeros((K, n_y, n_y + 1)),
            slope=np.zeros((K, n_y, n_y + 1)),
            gain=np.zeros((K, n_y, n_x + 1)),
        )


class LinearQuadratic:
    """A linear-quadratic problem, to be written, solved and read in the same memory any number of times.

    The first state is free unless constraints say otherwise. To the recursion it is the control of one more stage, before
    all others, which has no state and no cost and leads to x_0 = u.

    Args:
        nx: number of states of each stage ``(K,)``; the last one leads nowhere.
        nu: number of controls ``(K,)``.
        nc: number of equality constraints ``(K,)``.
        links: row and column of each nonzero of each stage's F ``(n_F, 2)``; few, as Euler steps have.

    Attributes:
        sizes: of the stages.
        coefficients: of the stages, to be written before ``solve``.
        optimum: what ``solve`` writes.
    """

    def __init__(
        self, nx: Sequence[int] | np.ndarray, nu: np.ndarray, nc: np.ndarray, links: Sequence[np.ndarray]
    ) -> None:
        before = [np.column_stack([np.arange(nx[0])] * 2)]  # of the stage that chooses the first state
        self._sizes = Sizes(
            nx=np.array([0, *nx], dtype=np.int64),
            nu=np.array([nx[0], *nu], dtype=np.int64),
            nc=np.array([0, *nc], dtype=np.int64),
            n_links=np.array([len(pairs) for pairs in [*before, *links]], dtype=np.int64),
        )
        self.sizes = Sizes(*(count[1:] for count in self._sizes))
        K, n_x, n_c, n_F = 1 + len(nx), int(max(nx)), int(max(nc)), int(max(self._sizes.n_links))
        n_y = int(max(self._sizes.nx + self._sizes.nu))
        self._coefficients = Coefficients(
            Q=np.zeros((K, n_y, n_y)),
            q=np.zeros((K, n_y)),
            links=np.zeros((K, n_F, 2), dtype=np.int64),
            F=np.zeros((K, n_F)),
            f=np.zeros((K, n_x)),
            C=np.zeros((K, n_c, n_y)),
            c=np.zeros((K, n_c)),
        )
        for k, pairs in enumerate([*before, *links]):
            self._coefficients.links[k, : len(pairs)] = pairs
        self._coefficients.F[0] = 1.0
        self._optimum = Optimum(y=np.zeros((K, n_y)), dynamics=np.zeros((K, n_x)), constraints=np.zeros((K, n_c)))
        self._factor = Factor.zeros(K, n_x, n_y, m=n_c + n_x)
        self.coefficients, self.optimum = self._coefficients.after_first(), self._optimum.after_first()

    def add_to_diagonal(self, value: float) -> None:
        """Add a multiple of the identity to the Hessian of every stage."""
        every = np.arange(self.coefficients.Q.shape[1])
        self.coefficients.Q[:, every, every] += value

    def solve(self) -> bool:
        """Write the solution and the multipliers into ``optimum``; return False, and write none, if there is no minimum.

        There is none if a direction that the constraints leave free has no positive curvature, or if more constraints of
        states alone are handed from stage to stage than a stage has states.
        """
        if not _backward(self._sizes, self._coefficients, self._factor):
            return False
        _forward(self._sizes, self._coefficients, self._factor, self._optimum)
        return True


@compiled
def _backward(sizes: Sizes, coefficients: Coefficients, factor: Factor) -> bool:
    """Fill ``factor`` from the last stage to the first; return whether there is a minimum."""
    nx, nu, n_links = sizes.nx, sizes.nu, sizes.n_links
    Q, q, links, F, f, _, _ = coefficients
    K = len(nx)
    to_go = np.zeros((1, 1))  # cost-to-go of the next state, as a matrix of [x; 1]
    for k in range(K - 1, -1, -1):
        U, X = _rows(k, sizes, coefficients, factor)
        if len(U) > factor.T.shape[1]:
            return False  # constraints of states pile up that no control can satisfy
        X, N, place = _eliminated(k, U, X, factor)
        rank = len(N)
        M = quadratic(Q[k], q[k], nu[k], place)
        if k + 1 < K:
            add_cost_to_go(M, to_go, links[k, : n_links[k]], F[k], f[k, : nx[k + 1]], place)
        substitute(M, N, factor.slope[k, :rank, : N.shape[1]])
        to_go, bounded = minimize(M, rank, nu[k] - rank, factor.gain[k])
        if not bounded:
            return False
        store(factor.P, k, to_go, nx[k])
        factor.n_h[k] = constraint_to_go(X, rank, factor.H[k], factor.H_rows[k])
        if factor.n_h[k] < 0:
            return False
    return True


@compiled
def _rows(k: int, sizes: Sizes, coefficients: Coefficients, factor: Factor) -> tuple[np.ndarray, np.ndarray]:
    """Return a stage's constraints and those of the next state as U u + X [x; 1] = 0, ``(m, n_u)`` and ``(m, n_x + 1)``."""
    last = k + 1 == len(sizes.nx)
    own, after = sizes.nc[k], 0 if last else factor.n_h[k + 1]
    U, X = np.zeros((own + after, sizes.nu[k])), np.zeros((own + after, sizes.nx[k] + 1))
    write_constraints(coefficients.C[k], coefficients.c[k, :own], U, X)
    if after > 0:
        links, f = coefficients.links[k, : sizes.n_links[k]], coefficients.f[k, : sizes.nx[k + 1]]
        write_next_constraints(factor.H[k + 1], links, coefficients.F[k], f, U[own:], X[own:])
    return U, X


@compiled
def _eliminated(k: int, U: np.ndarray, X: np.ndarray, factor: Factor) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve a stage's rows U u + X [x; 1] = 0 for as many controls as there can be, and note in ``factor`` how.

    Returns:
        The reduced rows' X; N ``(rank, ·)`` such that the eliminated controls are −N (free controls, x, 1); and at which
        place each entry of (u, x, 1) stands once the controls are ordered.
    """
    m, n_u = U.shape
    T, order = np.eye(m), np.arange(n_u)
    rank = reduce_rows(U, T, order)
    X = np.dot(T, X)
    N = solved_for_first(U, X, rank)
    place = np.arange(n_u + X.shape[1])
    place[order] = np.arange(n_u)
    factor.rank[k], factor.order[k, :n_u] = rank, order
    store(factor.T, k, T, m)
    store(factor.eliminated, k, N, rank)
    return X, N, place


@compiled
def _forward(sizes: Sizes, coefficients: Coefficients, factor: Factor, optimum: Optimum) -> None:
    """Write solution and multipliers from the first stage to the last."""
    nx, nu, nc, n_links = sizes
    K = len(nx)
    x, lam_H = np.zeros(0), np.zeros(0)  # the state, and the multipliers of the constraint-to-go on it
    for k in range(K):
        y = optimum.y[k, : nu[k] + nx[k]]
        y[nu[k] :] = x
        lam = _controls(k, factor, lam_H, nc[k] + (factor.n_h[k + 1] if k + 1 < K else 0), nu[k], y)
        optimum.constraints[k, : nc[k]] = lam[: nc[k]]
        lam_H = lam[nc[k] :]
        if k + 1 < K:
            n = nx[k + 1]
            x_1 = np.ones(n + 1)  # the next state and one
            x_1[:n] = coefficients.f[k, :n]
            for i in range(n_links[k]):
                x_1[coefficients.links[k, i, 0]] += coefficients.F[k, i] * y[coefficients.links[k, i, 1]]
            gradient = np.zeros(n)  # of all that follows, by the next state
            add_product(factor.P, k + 1, n, n + 1, 1.0, x_1, gradient)
            x = x_1[:n]
            for i in range(len(lam_H)):
                for j in range(n):
                    gradient[j] += lam_H[i] * factor.H[k + 1, i, j]
            optimum.dynamics[k, :n] = -gradient


@compiled
def _controls(k: int, factor: Factor, lam_H: np.ndarray, m: int, n_u: int, y: np.ndarray) -> np.ndarray:
    """Write the controls of a stage into y = (u, x), whose state is given; return the multipliers of its rows ``(m,)``.

    Args:
        k: stage.
        factor: of all stages.
        lam_H: multipliers of the constraint-to-go on the state.
        m: number of the stage's rows: its constraints, then those of the next state.
        n_u: number of controls.
        y: states and controls ``(n_u + n_x,)``.
    """
    rank, n_x = factor.rank[k], len(y) - n_u
    free = n_u - rank
    n = free + n_x + 1
    left = np.zeros(n)  # the free controls, the state and one
    left[free : n - 1] = y[n_u:]
    left[n - 1] = 1.0
    add_product(factor.gain, k, free, n_x + 1, 1.0, left[free:], left)
    eliminated = np.zeros(rank)
    add_product(factor.eliminated, k, rank, n, -1.0, left, eliminated)
    for i in range(n_u):
        y[factor.order[k, i]] = eliminated[i] if i < rank else left[i - rank]
    reduced, lam = np.zeros(m), np.zeros(m)  # multipliers of the reduced rows, and of the rows themselves
    add_product(factor.slope, k, rank, n, -1.0, left, reduced)
    for i in range(factor.n_h[k]):
        reduced[factor.H_rows[k, i]] = lam_H[i]
    for i in range(m):
        for j in range(m):
            lam[j] += factor.T[k, i, j] * reduced[i]
    return lam
