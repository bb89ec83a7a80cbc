"""Why a measured number is not the published one: every choice toggled, one at a time."""
