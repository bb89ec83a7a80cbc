"""How methods and datasets are declared, found, configured, selected and hashed."""
