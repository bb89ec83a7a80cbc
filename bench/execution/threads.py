"""Pin the threads of the numerical libraries in this process, and read back that they are pinned."""

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

_found: "tuple[int, ThreadpoolController] | None" = None  # number of modules at that time, and libraries


def pin_threads(threads: int) -> int:
    """Pin every numerical library that is loaded, and return the largest number of threads that any still has."""
    controller = find_libraries()
    controller.limit(limits=threads)
    counts = [library.num_threads for library in controller.lib_controllers]
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(threads)
        counts.append(torch.get_num_threads())
    return max(counts, default=threads)


def find_libraries() -> "ThreadpoolController":
    """Numerical libraries that are loaded; looked for again, in milliseconds, only when modules were imported since."""
    global _found
    import threadpoolctl

    if _found is None or _found[0] != len(sys.modules):
        _found = len(sys.modules), threadpoolctl.ThreadpoolController()
    return _found[1]
