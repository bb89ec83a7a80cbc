"""Folders and archives of real scenes: found, fetched and unpacked."""
