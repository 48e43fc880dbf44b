"""Converters from STEP to GLB for sbdp. README.md has the contract."""

__version__ = "0.1.0"


class Refusal(Exception):
    """The file cannot be converted. The message says why and what to do, in a sentence for the user."""
