"""MSP: propagation of rotations from several sources, and its derivative."""
