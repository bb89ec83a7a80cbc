"""Solve a problem in this process, without limits: for notebooks, and for programs that have their own."""

import copy
import time
from collections.abc import Collection, Mapping
from typing import Any

from bench.core.errors import InputError
from bench.core.problem import Estimate, Information, Problem
from bench.core.seeds import stream
from bench.execution.given import Given
from bench.execution.validate import what_is_wrong
from bench.plugins.declare import MethodInfo


def solve_here(
    info: MethodInfo,
    parameters: Mapping[str, Any],
    problem: Problem,
    seed: int = 0,
    use: Collection[Information] | None = None,
) -> Estimate:
    """The estimate that a supervised child would find; whatever the method raises comes through.

    Raises
    ------
    InputError
        Where a package that the method requires is missing, or what it returns is no estimate.
    """
    if info.not_installed(parameters):
        raise InputError(f"method '{info.name}' is not installed; get it with: {info.install_hint(parameters)}")
    method = info.configure(parameters)
    given = Given.of(problem, info, method, use, seed)
    pristine = copy.copy(given.problem)
    start = time.perf_counter()
    answer = method.solve(given.problem, stream(seed, "method", info.name))
    estimate = answer if isinstance(answer, Estimate) else Estimate(answer)
    if wrong := what_is_wrong(pristine, estimate, time.perf_counter() - start):
        raise InputError(f"method '{info.name}' returned no valid estimate: {wrong}")
    return given.restored(estimate)
