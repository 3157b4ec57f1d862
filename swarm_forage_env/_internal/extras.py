"""How to install what is optional."""

_BESIDE = {"train": ' "torch==2.13.0"'}


def install_command(extra: str) -> str:
    """Return the command that installs one of the extras of `pyproject.toml`, for messages.

    The package is in no registry: it is installed from a checkout.
    """
    return f'pip install ".[{extra}]"{_BESIDE.get(extra, "")} in the checkout of swarm_forage_env'
