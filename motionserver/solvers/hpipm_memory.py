"""Memory of the C library HPIPM for one set of sizes, and the calls on it."""

from __future__ import annotations

import ctypes
from itertools import pairwise
from typing import Final

import numpy as np

from motionserver.core.axes import Array
from motionserver.solvers.base import INFINITE
from motionserver.solvers.hpipm_library import library
from motionserver.solvers.stage import StageProgramme

Sizes = tuple[tuple[int, int, int, int], ...]
"""States, inputs, rows and soft rows of every stage."""

_SPEED_ABS: Final = 0
_BALANCE: Final = 2


def sizes_of(programme: StageProgramme) -> Sizes:
    """Sizes of a programme."""
    return tuple((*stage.sizes, len(stage.soft)) for stage in programme.stages)


class Memory:
    """All that the C side reads and writes; the state at the first stage is no variable in it.

    Args:
        sizes: Of the programme; every programme that is bound must have them.
        iterations: Budget.
        tolerance: At which it stops.
        exact: Take the mode that looks for accuracy, not the one that looks for speed.
        barrier: Complementarity it begins with.

    Attributes:
        lower: Lower bounds of all rows as handed over, (sum of g,); written by the caller.
        upper: Likewise.
        first_b: Dynamics of the first stage with its state put in, (n',).
        first_r: Cost of its inputs likewise, (k,).
    """

    def __init__(
        self, sizes: Sizes, iterations: int, tolerance: float, exact: bool, barrier: float
    ) -> None:
        self._c = library()
        self.sizes = sizes
        states, inputs, rows, soft = (list(column) for column in zip(*sizes, strict=True))
        rows_before, inputs_before = _before(rows), _before(inputs)
        self._row_parts = [slice(*ends) for ends in pairwise(rows_before)]
        self._input_parts = [slice(*ends) for ends in pairwise(inputs_before)]
        # the first state is given: the C side knows none there
        states[0] = 0
        self.lower, self.upper = np.zeros(rows_before[-1]), np.zeros(rows_before[-1])
        self.first_b, self.first_r = np.zeros(states[1]), np.zeros(inputs[0])
        self._u = np.zeros(inputs_before[-1])
        self._nothing = np.zeros(max(*soft, 1))
        self._masks = (np.ones(rows_before[-1]), np.ones(rows_before[-1]))
        self._create(states, inputs, rows, soft)
        self._c.d_ocp_qp_ipm_arg_set_default(_BALANCE if exact else _SPEED_ABS, self._arg)
        self._set("iter_max", ctypes.c_int(iterations))
        self._set("mu0", ctypes.c_double(barrier))
        for what in ("tol_stat", "tol_eq", "tol_ineq", "tol_comp"):
            self._set(what, ctypes.c_double(tolerance))
        # the residuals tell whether the rows have been met at all
        self._set("comp_dual_sol_eq", ctypes.c_int(1))
        self._set("comp_res_exit", ctypes.c_int(1))
        workspace = self._c.d_ocp_qp_ipm_ws_memsize(self._dim, self._arg)
        self._ws, self._ws_memory = self._block("ipm_ws", workspace)
        self._c.d_ocp_qp_ipm_ws_create(self._dim, self._arg, self._ws, self._ws_memory)

    def _create(
        self, states: list[int], inputs: list[int], rows: list[int], soft: list[int]
    ) -> None:
        c, last = self._c, len(states) - 1
        self._dim, self._dim_memory = self._block("dim", c.d_ocp_qp_dim_memsize(last))
        c.d_ocp_qp_dim_create(last, self._dim, self._dim_memory)
        columns = [(ctypes.c_int * (last + 1))(*column) for column in (states, inputs, rows, soft)]
        none = (ctypes.c_int * (last + 1))()
        c.d_ocp_qp_dim_set_all(
            columns[0], columns[1], none, none, columns[2], columns[3], self._dim
        )
        self._qp, self._qp_memory = self._block("", c.d_ocp_qp_memsize(self._dim))
        c.d_ocp_qp_create(self._dim, self._qp, self._qp_memory)
        self._sol, self._sol_memory = self._block("sol", c.d_ocp_qp_sol_memsize(self._dim))
        c.d_ocp_qp_sol_create(self._dim, self._sol, self._sol_memory)
        self._arg, self._arg_memory = self._block("ipm_arg", c.d_ocp_qp_ipm_arg_memsize(self._dim))
        c.d_ocp_qp_ipm_arg_create(self._dim, self._arg, self._arg_memory)

    def _block(self, kind: str, size: int) -> tuple[ctypes.Array[ctypes.c_char], ...]:
        """A structure of the library and the memory it manages, zeroed."""
        strsize = getattr(self._c, "_".join(filter(None, ("d_ocp_qp", kind, "strsize"))))()
        return ctypes.create_string_buffer(strsize), ctypes.create_string_buffer(max(size, 1))

    def _set(self, what: str, value: ctypes.c_int | ctypes.c_double) -> None:
        getattr(self._c, f"d_ocp_qp_ipm_arg_set_{what}")(ctypes.byref(value), self._arg)

    def bind(self, programme: StageProgramme) -> None:
        """Point at a programme's arrays; numbers written to them later are seen."""
        stages = programme.stages
        self._kept = programme
        of = {
            name: [getattr(stage, name) for stage in stages]
            for name in ("A", "B", "b", "Q", "S", "R", "q", "r", "C", "D")
        }
        of["b"][0], of["r"][0] = self.first_b, self.first_r
        order = [of[name] for name in ("A", "B", "b", "Q", "S", "R", "q", "r")]
        # neither boxes of states nor of inputs: indices, lower, upper
        order += [[]] * 6
        order += [of["C"], of["D"]]
        order += [[bounds[part] for part in self._row_parts] for bounds in (self.lower, self.upper)]
        quadratic, linear = ([getattr(s, n) for s in stages] for n in ("quadratic", "linear"))
        order += [quadratic, quadratic, linear, linear, [stage.soft for stage in stages], []]
        order += [[self._nothing] * len(stages)] * 2
        count = len(stages)
        self._pointers: list[ctypes.Array[ctypes.c_void_p] | None]
        self._pointers = [_addresses(arrays, count) for arrays in order]
        # which slack belongs to a row is said by `soft`, so not the other way round
        self._pointers[23] = None

    def hand_over(self) -> None:
        """Give all numbers to the C side; absent bounds are masked."""
        masks = []
        for bounds in (self.lower, self.upper):
            present = np.abs(bounds) < INFINITE
            bounds[~present] = 0.0
            masks.append(present.astype(np.float64))
        self._c.d_ocp_qp_set_all_rowmaj(*self._pointers, self._qp)
        setters = (self._c.d_ocp_qp_set_lg_mask, self._c.d_ocp_qp_set_ug_mask)
        for mask, old, setter in zip(masks, self._masks, setters, strict=True):
            if (mask == old).all():
                continue
            old[:] = mask
            for number, part in enumerate(self._row_parts):
                setter(number, old[part].ctypes.data, self._qp)

    def run(self, warm: bool) -> tuple[int, int]:
        """Solve.

        Args:
            warm: Begin at what is in memory from the last time.

        Returns:
            The library's status, and iterations used.
        """
        self._set("warm_start", ctypes.c_int(int(warm)))
        status, iterations = ctypes.c_int(), ctypes.c_int()
        self._c.d_ocp_qp_ipm_solve(self._qp, self._sol, self._arg, self._ws)
        self._c.d_ocp_qp_ipm_get_status(self._ws, ctypes.byref(status))
        self._c.d_ocp_qp_ipm_get_iter(self._ws, ctypes.byref(iterations))
        return status.value, iterations.value

    def broken(self) -> float:
        """By how much the worst row is broken after the last solve, slacks allowed."""
        worst = ctypes.c_double()
        self._c.d_ocp_qp_ipm_get_max_res_ineq(self._ws, ctypes.byref(worst))
        return worst.value

    def inputs(self) -> tuple[Array, ...]:
        """Inputs of every stage."""
        for number, part in enumerate(self._input_parts):
            self._c.d_ocp_qp_sol_get_u(number, self._sol, self._u[part].ctypes.data)
        u = self._u.copy()
        return tuple(u[part] for part in self._input_parts)


def _before(counts: list[int]) -> list[int]:
    return [0, *np.cumsum(counts).tolist()]


def _addresses(arrays: list[Array], count: int) -> ctypes.Array[ctypes.c_void_p]:
    return (ctypes.c_void_p * count)(*(array.ctypes.data for array in arrays))
