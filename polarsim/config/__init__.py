"""Configuration of a run.

1. `sections`: all keys with their units, and values derived from several keys
2. `checks`: checks that concern several sections
3. `digest`: digest of the options that can change a result
4. `model`: the complete and checked configuration
5. `reading`: a configuration from a file, a mapping or assignments
"""

from polarsim.config.model import Config
from polarsim.config.reading import (
    RELEASE_ROOT,
    config_schema,
    parse_assignment,
    parse_config,
    read_config,
    render_options,
)

__all__ = [
    "RELEASE_ROOT",
    "Config",
    "config_schema",
    "parse_assignment",
    "parse_config",
    "read_config",
    "render_options",
]
