"""Does the truth speak of the same rotations as the measurements? The mistakes that are known, tried one by one."""

from bench.scoring.conventions.diagnosis import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
