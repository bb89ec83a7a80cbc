"""The reference benchmark of rotation synchronization (multiple rotation averaging).

What there is for users: `run`, `solve`, `score`, `compare`, `recommend`, `report`, `catalog`, `Problem`, `Estimate`,
`Instance`.
What a plug-in needs besides: `method`, `dataset`, `parameter`, `Checkpoint`, `Skipped`, `Source`, `Missing`,
`InputError`, `suggestion`, `so3`, `stream`, `sample_triangles`, `closures`, for methods that learn `Learned` and
`Trainer`, and the array types `Floats` and `Ints`.
Each is imported when it is first used.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bench.api import compare as compare
    from bench.api import recommend as recommend
    from bench.api import report as report
    from bench.api import run as run
    from bench.api import score as score
    from bench.api import solve as solve
    from bench.core import so3 as so3
    from bench.core.errors import InputError as InputError
    from bench.core.errors import suggestion as suggestion
    from bench.core.problem import Checkpoint as Checkpoint
    from bench.core.problem import Estimate as Estimate
    from bench.core.problem import Floats as Floats
    from bench.core.problem import Instance as Instance
    from bench.core.problem import Ints as Ints
    from bench.core.problem import Problem as Problem
    from bench.core.problem import Skipped as Skipped
    from bench.core.seeds import stream as stream
    from bench.core.triangles import closures as closures
    from bench.core.triangles import sample_triangles as sample_triangles
    from bench.learning.learned import Learned as Learned
    from bench.learning.learned import Trainer as Trainer
    from bench.plugins.catalog import catalog as catalog
    from bench.plugins.configure import parameter as parameter
    from bench.plugins.declare import Missing as Missing
    from bench.plugins.declare import Source as Source
    from bench.plugins.declare import dataset as dataset
    from bench.plugins.declare import method as method

__version__ = "0.2.0"

# Where each name of the door lives.
HOMES = {
    **dict.fromkeys(("run", "solve", "score", "report", "compare", "recommend"), "bench.api"),
    **dict.fromkeys(
        ("Problem", "Estimate", "Instance", "Checkpoint", "Skipped", "Floats", "Ints"), "bench.core.problem"
    ),
    **dict.fromkeys(("method", "dataset", "Source", "Missing"), "bench.plugins.declare"),
    **dict.fromkeys(("Learned", "Trainer"), "bench.learning.learned"),
    "catalog": "bench.plugins.catalog",
    "parameter": "bench.plugins.configure",
    **dict.fromkeys(("InputError", "suggestion"), "bench.core.errors"),
    "stream": "bench.core.seeds",
    "so3": "bench.core.so3",
    **dict.fromkeys(("closures", "sample_triangles"), "bench.core.triangles"),
}
__all__ = sorted(HOMES)

_HERE = Path(__file__).parent
if not (_HERE / "methods").is_dir():  # a checkout: methods and datasets are the siblings of this bench, and of no other
    __path__.append(str(_HERE.parent))


def __getattr__(name: str) -> Any:
    if name not in HOMES:
        raise AttributeError(f"module 'bench' has no attribute {name!r}")
    home = import_module(HOMES[name])
    found = home if name == "so3" else getattr(home, name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return __all__
