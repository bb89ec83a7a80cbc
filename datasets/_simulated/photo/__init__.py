"""Photo collections: places, the cameras that stand in them, what they see, and the geometry of two views."""

import inspect
from pathlib import Path

from bench import so3, stream

# The files that decide what is simulated; part of the revision of every collection.
CODE = (*sorted(Path(__file__).parent.glob("*.py")), Path(str(so3.__file__)), Path(inspect.getfile(stream)))
