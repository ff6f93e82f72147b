"""The C library HPIPM by ctypes, from the wheel that ships it; nothing is compiled.

`casadi` carries HPIPM and BLASFEO as plain libraries with their C functions exported. They are
loaded from there without importing the package itself, which is large.
"""

from __future__ import annotations

import ctypes
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

SHIPPED_BY: Final = "casadi"
"""Package whose wheel carries the libraries."""

_POINTER = ctypes.c_void_p
_INT = ctypes.c_int
# what each function takes; those of _SIZES return a size
_SIZES: Final = {
    "dim_strsize": (),
    "dim_memsize": (_INT,),
    "strsize": (),
    "memsize": (_POINTER,),
    "sol_strsize": (),
    "sol_memsize": (_POINTER,),
    "ipm_arg_strsize": (),
    "ipm_arg_memsize": (_POINTER,),
    "ipm_ws_strsize": (),
    "ipm_ws_memsize": (_POINTER, _POINTER),
}
_CALLS: Final = {
    "dim_create": (_INT, _POINTER, _POINTER),
    "dim_set_all": (_POINTER,) * 7,
    "create": (_POINTER,) * 3,
    "sol_create": (_POINTER,) * 3,
    "ipm_arg_create": (_POINTER,) * 3,
    "ipm_arg_set_default": (_INT, _POINTER),
    "ipm_arg_set_iter_max": (_POINTER,) * 2,
    "ipm_arg_set_mu0": (_POINTER,) * 2,
    "ipm_arg_set_tol_stat": (_POINTER,) * 2,
    "ipm_arg_set_tol_eq": (_POINTER,) * 2,
    "ipm_arg_set_tol_ineq": (_POINTER,) * 2,
    "ipm_arg_set_tol_comp": (_POINTER,) * 2,
    "ipm_arg_set_warm_start": (_POINTER,) * 2,
    "ipm_arg_set_comp_dual_sol_eq": (_POINTER,) * 2,
    "ipm_arg_set_comp_res_exit": (_POINTER,) * 2,
    "ipm_ws_create": (_POINTER,) * 4,
    "set_all_rowmaj": (_POINTER,) * 27,
    "set_lg_mask": (_INT, _POINTER, _POINTER),
    "set_ug_mask": (_INT, _POINTER, _POINTER),
    "ipm_solve": (_POINTER,) * 4,
    "ipm_get_status": (_POINTER,) * 2,
    "ipm_get_iter": (_POINTER,) * 2,
    "ipm_get_max_res_ineq": (_POINTER,) * 2,
    "sol_get_u": (_INT, _POINTER, _POINTER),
}


class HpipmMissingError(ImportError):
    """The library is not there, or is another than it should be."""


@cache
def library() -> ctypes.CDLL:
    """Load HPIPM; its calls release the interpreter's lock.

    Raises:
        HpipmMissingError: It is not there, cannot be loaded or lacks a function.
    """
    folder = _folder()
    loaded = None
    try:
        # in this order: the first is what the second is linked against
        for name in ("libblasfeo.so.0", "libhpipm.so"):
            loaded = ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)
    except OSError as error:
        raise HpipmMissingError(f"libhpipm.so cannot be loaded from {folder}: {error}") from error
    assert loaded is not None
    try:
        for name, takes in {**_SIZES, **_CALLS}.items():
            function = getattr(loaded, f"d_ocp_qp_{name}")
            function.argtypes = takes
            function.restype = ctypes.c_size_t if name in _SIZES else None
    except AttributeError as error:
        raise HpipmMissingError(f"libhpipm.so in {folder} is another version: {error}") from error
    return loaded


def _folder() -> Path:
    try:
        spec = find_spec(SHIPPED_BY)
    except (ImportError, ValueError):
        spec = None
    if spec is None or spec.origin is None:
        raise HpipmMissingError(
            f"libhpipm.so: the package {SHIPPED_BY!r}, which ships it, is not installed"
        )
    return Path(spec.origin).parent
