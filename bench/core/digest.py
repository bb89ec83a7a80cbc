"""Names made of what they stand for."""

import hashlib
import json
from typing import Any


def digest(value: Any) -> str:
    """Hash of a JSON-like value, 24 hexadecimal digits."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]
