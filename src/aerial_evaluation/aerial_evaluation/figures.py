"""How figures reach the disk."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from aerial_model.errors import ConfigurationError


def save(figure: Figure, file: Path, resolution: int) -> None:
    """Write a figure as PNG, ``resolution`` dots per inch, in a folder that is made.

    Raises:
        ConfigurationError: if the file cannot be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file, dpi=resolution)
    except OSError as error:
        raise ConfigurationError(f"{file}: cannot be written ({error.strerror})") from None
