"""Rotation synchronization methods: one file, one method."""
