"""The TOML file that describes a problem, with the settings of its search and its campaign."""
