"""handctl: diagnostics and configuration of hand and exoskeleton devices, from the command line and from Python.

`handctl.connect`, `handctl.simulate`, `handctl.errors` and `handctl.hands` are loaded when they are used first.
"""

__version__ = "0.1.0"

TYPE_CHECKING = False  # the typing module is not worth its import time here
if TYPE_CHECKING:
    from handctl import errors as errors
    from handctl import hands as hands
    from handctl.errors import HandctlError as HandctlError
    from handctl.hands import connect as connect
    from handctl.hands import simulate as simulate
else:

    def __dir__() -> list[str]:
        return [*globals(), "HandctlError", "connect", "errors", "hands", "simulate"]

    def __getattr__(name: str) -> object:
        from importlib import import_module

        if name in ("errors", "hands"):
            return import_module(f"handctl.{name}")
        if name == "HandctlError":
            return import_module("handctl.errors").HandctlError
        if name in ("connect", "simulate"):
            return getattr(import_module("handctl.api"), name)
        raise AttributeError(f"module 'handctl' has no attribute {name!r}")
