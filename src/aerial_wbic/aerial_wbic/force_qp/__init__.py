"""The quadratic program of reaction forces, thesis (3.24), and its solvers."""

from aerial_wbic.force_qp.equations import TorqueHeadroom
from aerial_wbic.force_qp.optimization import ForceOptimization, Solution
from aerial_wbic.force_qp.solvers import SOLVERS, QpFactory, QuadraticProgram

__all__ = ["SOLVERS", "ForceOptimization", "QpFactory", "QuadraticProgram", "Solution", "TorqueHeadroom"]
