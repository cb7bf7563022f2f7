"""How an iterative solver ended: what every one of them returns beside its estimate."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Termination:
    """Whether a solver met its criterion, after how many iterations, and the cost that it reached.

    The criterion is stated where the solver is. Solvers of many problems at once return arrays of the same names.
    """

    converged: bool
    iterations: int
    cost: float
