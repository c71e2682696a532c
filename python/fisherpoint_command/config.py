"""The TOML file, as the commands read it."""

from fisherpoint.configuration.config import Config, ConfigError, load_config

__all__ = ["Config", "ConfigError", "load_config"]
