"""handctl: diagnostics and configuration of hand and exoskeleton devices from the command line."""

__version__ = "0.1.0"
