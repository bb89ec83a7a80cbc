"""Plans, instances, records and estimates on disk."""
