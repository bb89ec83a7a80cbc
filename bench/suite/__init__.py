"""A suite (TOML) becomes jobs: the cross product of instances, methods and seeds, each with its identity."""
