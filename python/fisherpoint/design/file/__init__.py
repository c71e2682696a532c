"""The TOML file of a problem."""
