"""`dataclass` and `NamedTuple` for what every command needs: the same to their user, and defined in a fraction of the time.

No slots and no order: a class that wants those, or that only some commands use, is a dataclass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__all__ = ("NamedTuple", "fast_dataclass", "field", "replace")

if TYPE_CHECKING:
    from dataclasses import dataclass as fast_dataclass
    from dataclasses import field, replace
    from typing import NamedTuple
else:
    from collections import namedtuple
    from functools import partial

    class _Tuple(type):
        """Makes the class of a tuple from annotations, which nobody looks into."""

        def __new__(cls, name: str, bases: tuple[type, ...], body: dict[str, Any]) -> type:
            if not bases:
                return super().__new__(cls, name, bases, body)
            fields = body["__annotations__"]
            defaults = [body[field] for field in fields if field in body]
            made = namedtuple(name, fields, defaults=defaults, module=body["__module__"])
            for key, value in body.items():
                if key not in fields and key not in ("__annotations__", "__module__", "__qualname__", "__classcell__"):
                    setattr(made, key, value)
            return made

    class NamedTuple(metaclass=_Tuple):
        """The base of tuples with names."""

    field = namedtuple("field", "default_factory")
    """A default that each object gets its own of."""

    def fast_dataclass(cls: type | None = None, *, frozen: bool = False, kw_only: bool = False, eq: bool = True) -> Any:
        """Decorator: a class whose annotations are the arguments of its `__init__`, after those of the class above."""
        if cls is None:
            return partial(fast_dataclass, frozen=frozen, kw_only=kw_only, eq=eq)
        fields = [*getattr(cls, "__match_args__", ())]
        fields += [name for name in cls.__annotations__ if name not in fields]
        names: dict[str, Any] = {}
        # What does not change has no way in but its `__dict__`; of all others the attributes are quicker, made and read.
        parts, lines = [], ["d = self.__dict__" if frozen else "pass"]
        put = "d[{!r}]" if frozen else "self.{}"
        for name in fields:
            default = getattr(cls, name, names)
            if default is names:
                parts.append(name)
                lines.append(f"{put.format(name)} = {name}")
                continue
            names[f"_{name}"] = default.default_factory if isinstance(default, field) else default
            parts.append(f"{name}=_{name}")
            if isinstance(default, field):
                lines.append(f"{put.format(name)} = _{name}() if {name} is _{name} else {name}")
            else:  # its class has it already
                lines.append(f"if {name} is not _{name}: {put.format(name)} = {name}")
        cls.__match_args__ = tuple(fields)
        head = f"def __init__(self, {'*, ' if kw_only else ''}{', '.join(parts)}):"
        exec("\n ".join([head, *lines]), names)  # noqa: S102 - the text is made of the class alone
        cls.__init__ = names["__init__"]
        cls.__repr__ = _shown
        if eq:
            cls.__eq__ = _same
            cls.__hash__ = _hashed if frozen else None
        if frozen:
            cls.__setattr__ = cls.__delattr__ = _refused
        return cls

    def replace(one: Any, /, **changes: Any) -> Any:
        """As of dataclasses."""
        return type(one)(**{**{name: getattr(one, name) for name in one.__match_args__}, **changes})

    def _values(one: Any) -> tuple[Any, ...]:
        return tuple(getattr(one, name) for name in one.__match_args__)

    def _shown(self: Any) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__match_args__)})"

    def _same(self: Any, other: object) -> bool:
        return _values(self) == _values(other) if type(other) is type(self) else NotImplemented

    def _hashed(self: Any) -> int:
        return hash(_values(self))

    def _refused(self: Any, name: str, *_: object) -> None:
        raise AttributeError(f"{name}: a {type(self).__name__} does not change")
