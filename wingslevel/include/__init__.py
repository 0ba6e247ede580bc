"""The folder of the C header: ``cc -I"$(python -m wingslevel.include)" ...``."""

from pathlib import Path


def get_include() -> str:
    """The folder that holds ``wingslevel_estimator.h``."""
    return str(Path(__file__).resolve().parent)
