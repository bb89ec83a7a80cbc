"""Numbers that papers have printed; README.md says where each file comes from."""
