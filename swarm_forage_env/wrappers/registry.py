"""Wrapper configurations by the name that stored specifications, the command line and TOML files use."""

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.fields import ConfigError, checked, known_name, settings, table

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig

WRAPPERS: dict[str, str] = {
    "sensor_noise": "swarm_forage_env.wrappers.noise:SensorNoiseConfig",
    "population": "swarm_forage_env.wrappers.population:PopulationConfig",
    "throttle": "swarm_forage_env.wrappers.throttle:ThrottleConfig",
    "actuator_noise": "swarm_forage_env.wrappers.noise:ActuatorNoiseConfig",
    "handling_cost": "swarm_forage_env.wrappers.handling:HandlingCostConfig",
}
"""Name -> "module:class" of a `WrapperConfig`. Strings, so that reading a specification imports only what it names."""


def wrapper_config_class(name: str) -> "type[WrapperConfig]":
    """Return the configuration class registered under `name`.

    Raises:
        ConfigError: no wrapper has that name.
    """
    known_name("wrapper", name, sorted(WRAPPERS))
    module, _, class_name = WRAPPERS[name].partition(":")
    return getattr(import_module(module), class_name)


def parse_wrapper(text: str) -> "WrapperConfig":
    """Build a wrapper configuration from one word of a command line.

    The form is `name:key=value,key=value`, see `settings`:

        throttle:waveform=square,amplitude=0.2,period_s=5000,carriers=true
        sensor_noise:sigma=0.03,groups=proximity+light,sigmas.position=0.1

    Raises:
        ConfigError: an unknown name or key, a word that is no key=value, no settings, or values that the
            wrapper refuses; the message has an example.
    """
    name, _, words = checked("a wrapper", text, str).strip().partition(":")
    config_class = wrapper_config_class(name)
    try:
        return config_class.from_mapping(settings("the settings of a wrapper", words))
    except ConfigError as error:
        raise ConfigError(f"{error} For example: {name}:{config_class.example}") from error


def wrapper_configs(given: "Iterable[WrapperConfig | str]") -> "tuple[WrapperConfig, ...]":
    """Return wrapper configurations, words read as on the command line; see `parse_wrapper`.

    Raises:
        ConfigError: `given` is no list, an item is neither a configuration nor a word, or a word names no wrapper.
    """
    if given == ():
        return ()
    from swarm_forage_env.wrappers.base import WrapperConfig  # late: this import loads the whole environment

    expected = "Expected wrappers as a list of configurations or words such as 'sensor_noise:sigma=0.1', got"
    if isinstance(given, str | Mapping) or not isinstance(given, Iterable):
        raise ConfigError(f"{expected} {given!r}.")
    configs = tuple(parse_wrapper(one) if isinstance(one, str) else one for one in given)
    for config in configs:
        if not isinstance(config, WrapperConfig):
            raise ConfigError(f"{expected} {config!r} in it.")
    return configs


def wrappers_from_mapping(tables: Mapping[str, Any]) -> "tuple[WrapperConfig, ...]":
    """Build wrapper configurations from tables by name, as a TOML file has them.

    Args:
        tables: Name -> fields, for example `{"throttle": {"waveform": "constant", "amplitude": 0.1}}`.

    Returns:
        The configurations in the order of the stack, outermost first.

    Raises:
        ConfigError: an unknown name or key, or values that a wrapper refuses.
    """
    configs = [
        wrapper_config_class(name).from_mapping(table(f"the settings of wrapper {name}", fields))
        for name, fields in tables.items()
    ]
    return tuple(sorted(configs, key=lambda config: config.stack_position))
