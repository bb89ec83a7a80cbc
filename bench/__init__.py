"""The reference benchmark of rotation synchronization (multiple rotation averaging)."""

__version__ = "0.1.0"
